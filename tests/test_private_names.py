"""Private names of other packages: where they are used, whether they are still there, and a cap on the version."""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Iterator
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

import optuna
import pytest
from packaging.requirements import Requirement
from places import ROOT

from metaid.errors import StudyError

OPTUNA, RAY = ROOT / "metaid/store/optuna_tables.py", ROOT / "metaid/study/evaluation/ray_private.py"
METRIC = ROOT / "metaid/search/optuna_samplers/metric.py"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
NEEDED = {requirement.name: requirement for requirement in map(Requirement, PROJECT["dependencies"])}


def private_imports(path: Path) -> Iterator[tuple[str, list[str]]]:
    """The private modules of other packages that a file imports from, and the names."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            names = [alias.name for alias in node.names]
            parts = [*(node.module or "").split("."), *(name for name in names if name.startswith("_"))]
            if parts[0] not in ("metaid", "__future__") and any(part.startswith("_") for part in parts):
                yield node.module or "", names
        elif isinstance(node, ast.Import):
            yield from ((alias.name, []) for alias in node.names if "._" in alias.name)


@pytest.mark.slow
def test_private_modules_are_imported_in_one_place_each() -> None:
    """What another package may change at any time is behind one small module."""
    places = {path for path in (ROOT / "metaid").rglob("*.py") if list(private_imports(path))}
    assert places == {OPTUNA, RAY}


@pytest.mark.parametrize(("module", "names"), list(private_imports(OPTUNA)))
def test_tables_of_optuna_are_there(module: str, names: list[str]) -> None:
    """Each class that rows are written through."""
    for name in names:
        assert hasattr(import_module(module), name), f"Optuna {version('optuna')} has no {module}.{name}: {OPTUNA}"


def test_method_of_optuna_through_which_a_sampler_is_shown_other_trials_is_there() -> None:
    """A sampler asks a study's `_get_trials` for its trials."""
    assert hasattr(optuna.Study, "_get_trials"), f"Optuna {version('optuna')} has no Study._get_trials: {METRIC}"


@pytest.mark.parametrize("name", ["ENABLE_RAY_CLUSTERS_ENV_VAR", "ENABLE_RAY_CLUSTER"])
def test_switch_that_keeps_ray_to_loopback_is_there(name: str) -> None:
    """Read by Ray's own processes, and by the one that starts them."""
    constants = import_module("ray._private.ray_constants")
    assert hasattr(constants, name), f"Ray {version('ray')} has no {constants.__name__}.{name}: {RAY}"


def test_ray_that_cannot_be_kept_to_loopback_is_not_started(monkeypatch: pytest.MonkeyPatch) -> None:
    """A version without the switch is refused in one line that says which name is missing."""
    from metaid.study.evaluation.ray_private import ray_on_loopback

    monkeypatch.delattr("ray._private.ray_constants.ENABLE_RAY_CLUSTER")
    with pytest.raises(StudyError, match=r"Ray [\d.]+ cannot be kept .*'ENABLE_RAY_CLUSTER'"), ray_on_loopback():
        pytest.fail("it would have been started")


@pytest.mark.parametrize("package", ["cmaes", "llvmlite", "mujoco-core", "numba", "optuna", "ray"])
def test_version_of_a_package_whose_private_names_are_used_is_capped(package: str) -> None:
    """After a version that the tests ran with: a newer one is not installed before it has been tried."""
    need = NEEDED[package]
    assert [bound for bound in need.specifier if bound.operator == "<"]
    assert version(package) in need.specifier
