"""What docstrings owe: a line for each parameter of a long list, equations that exist, examples that hold."""

from __future__ import annotations

import ast
import doctest
import inspect
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import optuna
import pytest
from places import ROOT
from remembered import estimate_once

import metaid.api

LONGEST = 100  # characters of a line that an example prints
FEW = 3  # parameters; so many need no section of their own
COMMANDS = ("command", "group")  # decorators of click: a command's docstring is what `--help` prints
Function = ast.FunctionDef | ast.AsyncFunctionDef


def parameters(function: Function) -> list[str]:
    """The names of a function's parameters, besides self and cls."""
    given = function.args
    plain = [*given.posonlyargs, *given.args, *given.kwonlyargs]
    starred = [each for each in (given.vararg, given.kwarg) if each is not None]
    return [each.arg for each in (*plain, *starred) if each.arg not in ("self", "cls")]


def is_command(function: Function) -> bool:
    """Whether click makes a command of it."""
    called = [each.func if isinstance(each, ast.Call) else each for each in function.decorator_list]
    return any(ast.unparse(each).rpartition(".")[2] in COMMANDS for each in called)


def public_functions(tree: ast.AST, of_class: ast.ClassDef | None = None) -> Iterator[tuple[Function, str]]:
    """The public functions and methods in a syntax tree, each with its docstring.

    The docstring of a class may have the parameters of its `__init__`.
    """
    for node in ast.iter_child_nodes(tree):
        inside = node if isinstance(node, ast.ClassDef) else None
        if isinstance(node, Function):
            text = ast.get_docstring(node) or ""
            if node.name == "__init__" and of_class is not None:
                yield node, text or ast.get_docstring(of_class) or ""
            elif not node.name.startswith("_"):
                yield node, text
        if not (inside and inside.name.startswith("_")):
            yield from public_functions(node, inside)


def named_in_args(docstring: str) -> set[str]:
    """The parameters that have a line in the section `Args:`."""
    section = re.search(r"^Args:\n((?: {4}.*\n?|\n)+)", inspect.cleandoc(docstring), flags=re.MULTILINE)
    lines = re.findall(r"^ {4}([\w, ]+):", section[1], flags=re.MULTILINE) if section else []
    return {name.strip() for line in lines for name in line.split(",")}


SOURCES = sorted((ROOT / "metaid").rglob("*.py"))


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_docstring_of_a_public_function_of_more_than_three_parameters_names_each(path: Path) -> None:
    """It has a section `Args:` with a line for every parameter and none for anything else; click commands are apart."""
    for function, docstring in public_functions(ast.parse(path.read_text(encoding="utf-8"))):
        names, lines = set(parameters(function)), named_in_args(docstring)
        needed = names if len(names) > FEW and not is_command(function) else set()
        assert not needed - lines, f"{path}:{function.lineno}: Args of {function.name} lack {needed - lines}"
        assert not lines - names, f"{path}:{function.lineno}: {function.name} has no parameters {lines - names}"


def test_equations_of_the_method_are_cited_and_those_that_are_cited_exist() -> None:
    """docs/method.md numbers each equation once, from 1 on, and the code cites every one and no other."""
    method = (ROOT / "docs" / "method.md").read_text(encoding="utf-8")
    numbers = [int(number) for number in re.findall(r"(?:\*\*|^\| )\((\d+)\)(?:\*\*| \|)", method, flags=re.MULTILINE)]
    several = r"\bEqs?\.\s+(\d+(?:(?:,|\s+and|\s+to)\s+\d+)*)(?!\d|\s+of\s+the\s+paper|\s+and\s+\d|,\s+\d)"
    cited = set()
    for path in SOURCES:
        for text in re.findall(several, path.read_text(encoding="utf-8")):
            for first, last in re.findall(r"(\d+)(?:\s+to\s+(\d+))?", text):
                cited |= set(range(int(first), int(last or first) + 1))
    assert sorted(numbers) == list(range(1, len(numbers) + 1))
    assert cited == set(numbers)


CALLS = {name: getattr(metaid, name) for name in metaid.__all__} | {"study": metaid.api.study}
CALLS = {name: call for name, call in CALLS.items() if ">>>" in (call.__doc__ or "")}


@pytest.fixture(scope="module")
def studied(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder whose metaid.db has the study that examples are of."""
    folder = tmp_path_factory.mktemp("examples")
    metaid.run("three-link-oscillation", storage=str(folder / "metaid.db"))
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("name", CALLS)
def test_example_in_the_docstring_of_a_call_is_what_it_prints(
    name: str, studied: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a folder with a DB that has the one study."""
    shutil.copytree(studied, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("METAID_STORAGE", raising=False)
    estimate_once(monkeypatch)
    names = {"metaid": metaid, "np": np, "optuna": optuna}
    (test,) = doctest.DocTestFinder(recurse=False).find(CALLS[name], name, globs=names)
    printed: list[str] = []
    runner = doctest.DocTestRunner(verbose=False)
    assert runner.run(test, out=printed.append).failed == 0, "".join(printed)
    assert max(len(line) for example in test.examples for line in example.want.splitlines() or [""]) <= LONGEST


def test_every_call_that_help_names_first_has_an_example() -> None:
    """`help(metaid)` begins with ten calls, one a line."""
    text = inspect.getdoc(metaid) or ""
    named = re.findall(r"^    (\w+)\(", text, flags=re.MULTILINE)
    assert len(named) == 10
    assert set(named) <= CALLS.keys() & set(metaid.__all__)
