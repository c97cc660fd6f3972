"""What metaid stands on is pinned, licensed and looked after; an audit that could not be made never says that all is
well.
"""

from __future__ import annotations

import json
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version
from places import ROOT

from supply.licences import ALLOWED_IN_DEVELOPMENT, READ_BY_HAND, licences, refused
from supply.pins import are_installed, direct, installed, pinned
from supply.vulnerabilities import CANARY, AuditError, vulnerabilities

PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
DIRECT = direct(PYPROJECT["project"])
SITE, ROBOTS = (PYPROJECT["dependency-groups"][name] for name in ("docs", "robots"))
PINNED, LOWEST = pinned(ROOT / "constraints.txt"), pinned(ROOT / "constraints-min.txt")
PINNED_ROBOTS = pinned(ROOT / "constraints-robots.txt")


def test_every_dependency_is_pinned() -> None:
    """What this environment has for metaid and all its extras, down to the last: a version in the constraints."""
    assert set(installed(DIRECT)) <= set(PINNED) | set(LOWEST)


@pytest.mark.parametrize("need", DIRECT)
def test_lowest_version_that_is_allowed_is_the_one_that_is_tested(need: str) -> None:
    """Each direct dependency has a lower bound, and `make test-min` installs just that."""
    requirement = Requirement(need)
    lower = [bound.version for bound in requirement.specifier if bound.operator == ">="]
    assert len(lower) == 1
    assert Version(LOWEST[canonicalize_name(requirement.name)]) == Version(lower[0])


@pytest.fixture(scope="module")
def pip_licenses() -> list[str]:
    """The tool that reads licences."""
    tool = ROOT / ".venv-tools" / "bin" / "pip-licenses"
    if not tool.exists():
        pytest.skip("`make test` installs pip-licenses")
    return [str(tool)]


@pytest.mark.slow
def test_licences_of_what_is_pinned_are_allowed(pip_licenses: list[str]) -> None:
    """Each as the package itself tells it."""
    here = {name for name, package in installed(DIRECT).items() if PINNED.get(name) == package.version}
    assert refused(here, licences(sys.executable, pip_licenses)) == {}


@pytest.mark.slow
def test_every_dependency_of_the_site_is_pinned_and_has_an_allowed_licence(site: Path, pip_licenses: list[str]) -> None:
    """What `make docs` has installed for itself, down to the last package."""
    assert site.is_dir()
    here = installed(SITE, ROOT / ".venv-docs")
    assert {name: package.version for name, package in here.items() if PINNED.get(name) != package.version} == {}
    assert refused(here, licences(ROOT / ".venv-docs" / "bin" / "python", pip_licenses)) == {}


def test_robots_are_pinned_within_their_bounds_and_apart_from_all_else() -> None:
    """What `make robots` alone installs is in no other constraints file, so that nothing else waits for 820 MB."""
    for need in ROBOTS:
        requirement = Requirement(need)
        assert requirement.specifier.contains(PINNED_ROBOTS[canonicalize_name(requirement.name)])
    assert not set(PINNED_ROBOTS) & (set(PINNED) | set(LOWEST))


@pytest.mark.robots
@pytest.mark.skipif(not are_installed(ROBOTS), reason="`make robots` installs them")
def test_robots_that_are_installed_are_those_that_are_pinned_under_licences_that_are_allowed(
    pip_licenses: list[str],
) -> None:
    """Down to the last package."""
    here = installed(ROBOTS)
    assert set(PINNED_ROBOTS) == set(here) - set(PINNED)
    assert {name: here[name].version for name in PINNED_ROBOTS} == PINNED_ROBOTS
    assert refused(PINNED_ROBOTS, licences(sys.executable, pip_licenses), ALLOWED_IN_DEVELOPMENT) == {}


def test_licence_that_was_read_by_hand_is_that_of_the_version_that_is_pinned() -> None:
    """With where it was read; of another version nothing is known, and what a package states goes before it."""
    for name, read in READ_BY_HAND.items():
        assert read.version == (PINNED | PINNED_ROBOTS)[name]
        assert "https://" in read.source
        here, unknown = read.version, "UNKNOWN"
        for version, stated, told in ((here, unknown, read.licence), ("0", unknown, unknown), (here, "MIT", "MIT")):
            answer = json.dumps([{"Name": name, "Version": version, "License": stated}])
            assert licences(sys.executable, [sys.executable, "-c", f"print({answer!r})"]) == {name: told}


def test_licence_is_allowed_only_where_it_is_known_to_be() -> None:
    """One that is not in the list is refused with its package, and so is a package of which nothing is said."""
    stated = {"a": "MIT", "b": "GPL-3.0-only AND MIT", "c": "LGPL-3.0-or-later"}
    assert refused("abcd", stated) == {"b": "GPL-3.0-only AND MIT", "c": "LGPL-3.0-or-later", "d": "UNKNOWN"}
    assert refused("abcd", stated, ALLOWED_IN_DEVELOPMENT) == {"b": "GPL-3.0-only AND MIT", "d": "UNKNOWN"}


def answering(*answers: object) -> list[str]:
    """A command that answers as pip-audit does: with the first to the list of pins, with the last to the canary."""
    code = f"import sys; print({answers[0]!r} if 'numpy' in open(sys.argv[-1]).read() else {answers[-1]!r})"
    return [sys.executable, "-c", code]


def answer_of(name: str, *advisories: str) -> str:
    """pip-audit's answer about one package."""
    return json.dumps({"dependencies": [{"name": name, "version": "1", "vulns": [{"id": i} for i in advisories]}]})


CAUGHT = answer_of(CANARY[0], "CVE-2014-1402")
SKIPPED = json.dumps({"dependencies": [{"name": "numpy", "skip_reason": "Dependency not found on PyPI"}]})


def test_advisories_are_listed_by_package() -> None:
    """And nothing of those that have none."""
    assert vulnerabilities({"numpy": "1"}, answering(answer_of("numpy", "CVE-1"), CAUGHT)) == {"numpy": ["CVE-1"]}
    assert vulnerabilities({"numpy": "1"}, answering(answer_of("numpy"), CAUGHT)) == {}


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (answering(SKIPPED, CAUGHT), "no answer for 1 of 1 packages: numpy"),
        (answering(answer_of("numpy"), answer_of(CANARY[0])), "knows nothing of jinja2 2.4.1"),
        (answering("", CAUGHT), "no answer"),
        (["no-such-program"], "No such file"),
    ],
)
def test_audit_that_was_not_made_is_not_a_clean_one(command: list[str], message: str) -> None:
    """Packages passed over, a mirror without advisories, no network, no pip-audit."""
    with pytest.raises(AuditError, match=message):
        vulnerabilities({"numpy": "1"}, command)
