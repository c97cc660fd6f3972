"""Known vulnerabilities of what is pinned, by pip-audit, which asks PyPI's advisory database."""

from __future__ import annotations

import json
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

# A version with advisories since 2014: where none is reported for it, no advisories are to be had there at all.
CANARY = "jinja2", "2.4.1"


class AuditError(Exception):
    """The audit could not be made; not that it found nothing."""


def vulnerabilities(pins: Mapping[str, str], pip_audit: Sequence[str]) -> dict[str, list[str]]:
    """The advisories of each package that has any, by name.  Raises AuditError where that cannot be said of all."""
    found = _ask_pip_audit({**pins}, pip_audit)
    name, version = CANARY
    if not _ask_pip_audit({name: version}, pip_audit)[name]:
        raise AuditError(f"the advisory database knows nothing of {name} {version}, so it is none")
    return {name: advisories for name, advisories in found.items() if advisories}


def _ask_pip_audit(pins: Mapping[str, str], pip_audit: Sequence[str]) -> dict[str, list[str]]:
    with tempfile.TemporaryDirectory() as folder:
        wanted = Path(folder) / "pins.txt"
        wanted.write_text("".join(f"{name}=={version}\n" for name, version in pins.items()))
        flags = ["--no-deps", "--disable-pip", "--progress-spinner=off", "--format=json", "-r", str(wanted)]
        try:
            done = subprocess.run([*pip_audit, *flags], capture_output=True, text=True)
        except OSError as problem:
            raise AuditError(f"{pip_audit[0]}: {problem.strerror}") from None
    return _read(done.stdout, done.stderr, pins)


def _read(out: str, err: str, pins: Mapping[str, str]) -> dict[str, list[str]]:
    """Advisories by package from pip-audit's JSON; of every package, or AuditError."""
    try:
        answers: list[dict[str, Any]] = json.loads(out)["dependencies"]
    except (ValueError, LookupError):
        last = err.strip().splitlines()[-1:] or ["no answer"]
        raise AuditError(f"pip-audit: {last[0][:300]}") from None
    found = {answer["name"]: [v["id"] for v in answer["vulns"]] for answer in answers if "vulns" in answer}
    missing = sorted(set(pins) - set(found))
    if missing:
        raise AuditError(f"no answer for {len(missing)} of {len(pins)} packages: {', '.join(missing[:3])} …")
    return found
