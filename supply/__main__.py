"""Prints every dependency with its licence and known vulnerabilities: exit status 1 if there is something wrong with
any, 2 if the advisory database cannot be reached, so that nothing is known.

python -m supply [PIP_AUDIT]
"""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

from supply.licences import is_allowed, licence
from supply.pins import direct, installed, pinned
from supply.vulnerabilities import AuditError, vulnerabilities

ROOT = Path(__file__).parent.parent


def main() -> None:
    """The audit of what is installed here."""
    pyproject = tomllib.loads((ROOT / "pyproject.toml").read_text())
    packages = installed(direct(pyproject["project"]))
    packages |= installed(pyproject["dependency-groups"]["docs"], ROOT / ".venv-docs")
    pins = pinned(ROOT / "constraints.txt")
    wrong = []
    for name, package in sorted(packages.items()):
        expression = licence(package)
        print(f"{name:28} {package.version:16} {expression or 'UNKNOWN'}")
        if not is_allowed(expression):
            wrong.append(f"{name}: licence {expression or 'unknown'} is not among those allowed in supply/licences.py")
        if pins.get(name) != package.version:
            wrong.append(f"{name} {package.version} is not what constraints.txt pins ({pins.get(name, 'nothing')})")
    reached = True
    try:
        found = vulnerabilities(pins, sys.argv[1:] or ["pip-audit"])
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
