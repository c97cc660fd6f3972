"""Prints every dependency with its licence and known vulnerabilities: exit status 1 if there is something wrong with
any, 2 if the advisory database cannot be reached, so that nothing is known. `make audit` has the tools that it asks.
"""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

from supply.licences import ALLOWED_IN_DEVELOPMENT, READ_BY_HAND, licences, refused
from supply.pins import are_installed, direct, installed, pinned
from supply.vulnerabilities import AuditError, vulnerabilities

ROOT = Path(__file__).parent.parent
TOOLS = ROOT / ".venv-tools" / "bin"


def main() -> None:
    """The audit of what is installed here."""
    pyproject = tomllib.loads((ROOT / "pyproject.toml").read_text())
    groups = pyproject["dependency-groups"]
    needed = installed(direct(pyproject["project"]))
    tools = installed(groups["docs"], ROOT / ".venv-docs")
    has_robots = are_installed(groups["robots"])
    if has_robots:
        tools |= installed(groups["robots"])
    packages = tools | needed
    pip_licenses = [str(TOOLS / "pip-licenses")]
    pythons = ROOT / ".venv-docs" / "bin" / "python", sys.executable
    stated = {name: each for python in pythons for name, each in licences(python, pip_licenses).items()}
    pins = pinned(ROOT / "constraints.txt") | pinned(ROOT / "constraints-robots.txt")
    bad = refused(needed, stated) | refused(set(tools) - set(needed), stated, ALLOWED_IN_DEVELOPMENT)
    wrong = [f"{name}: licence {bad[name]} is not among those allowed in supply/licences.py" for name in sorted(bad)]
    for name, package in sorted(packages.items()):
        by_hand = f" (read by hand: {READ_BY_HAND[name].source})" if name in READ_BY_HAND else ""
        print(f"{name:28} {package.version:16} {stated.get(name, 'UNKNOWN')}{by_hand}")
        if pins.get(name) != package.version:
            wrong.append(f"{name} {package.version} is not what is pinned ({pins.get(name, 'nothing')})")
    if not has_robots:
        print("what `make robots` installs is not here: its licences NOT CHECKED", file=sys.stderr)
    reached = True
    try:
        found = vulnerabilities(pins, [str(TOOLS / "pip-audit")])
        wrong += [f"{name} {pins[name]}: {', '.join(advisories)}" for name, advisories in found.items()]
    except AuditError as problem:
        reached = False
        print(f"vulnerabilities NOT CHECKED, which needs the internet: {problem}", file=sys.stderr)
    for line in wrong:
        print(line, file=sys.stderr)
    checked = "pins, licences and vulnerabilities" if reached else "pins and licences alone"
    print(f"{len(packages)} packages, {len(pins)} pins; {checked} checked; {len(wrong)} wrong")
    sys.exit(1 if wrong else 0 if reached else 2)


if __name__ == "__main__":
    main()
