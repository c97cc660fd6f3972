"""What docstrings owe: a line for each parameter of a long list, and numbers of equations that exist."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from places import ROOT

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
