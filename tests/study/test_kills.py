"""A driver that is killed at any moment loses nothing that was in the DB."""

from __future__ import annotations

from pathlib import Path

import pytest

from soak.kills import CHANGES, kill_often

pytestmark = pytest.mark.slow


def test_killed_run_goes_on_as_if_nothing_had_happened(tmp_path: Path) -> None:
    """SIGKILL at several moments, then resume: the same trials, and none RUNNING, doubled or lost."""
    shorter = {**CHANGES["cmaes"], "trials": 1000}  # what is left after the kills tells nothing more
    assert kill_often(tmp_path, "cmaes", shorter, 2) == (2, [])
