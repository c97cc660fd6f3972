"""What is released says of itself what it is: its version, the Pythons that it runs on, all of its files."""

from __future__ import annotations

import re
import subprocess
import sys
import tarfile
import tomllib
from pathlib import Path

import pytest
import yaml
from packaging.specifiers import SpecifierSet
from places import ROOT

import metaid

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_changelog_and_citation_have_the_version_and_its_day() -> None:
    """The newest section of CHANGELOG.md is of this version; a section has a version and a day, the newest first."""
    headings = re.findall(r"^## (.+)$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    sections = [re.fullmatch(r"(\d+\.\d+\.\d+) \((\d{4}-\d\d-\d\d)\)", heading) for heading in headings]
    told = [(section[1], section[2]) for section in sections if section]
    assert len(told) == len(headings)
    assert told == sorted(told, reverse=True)
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert (metaid.__version__, citation["date-released"]) == told[0]
    assert citation["version"] == metaid.__version__
    assert [author["name"] for author in citation["authors"]] == [author["name"] for author in PROJECT["authors"]]


def test_workflow_runs_what_the_project_says_on_the_pythons_that_it_names() -> None:
    """`.ci/run` on each Python of the classifiers; the first is the oldest that is allowed."""
    (job,) = yaml.safe_load((ROOT / ".github" / "workflows" / "ci.yml").read_text())["jobs"].values()
    named = [line.rpartition(" ")[2] for line in PROJECT["classifiers"] if line.startswith("Programming Language")]
    assert job["strategy"]["matrix"]["python"] == named
    assert PROJECT["requires-python"] == SpecifierSet(f">={named[0]}")
    assert job["steps"][-1]["run"] == ".ci/run"


@pytest.mark.slow
@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="only git knows which files are the repository's")
def test_sdist_has_every_file_of_the_repository(tmp_path: Path) -> None:
    """So its tests run, its site is made, and the wheel is built from it."""
    command = [sys.executable, "-m", "build", "--sdist", "--no-isolation", "--outdir", str(tmp_path), str(ROOT)]
    subprocess.run(command, check=True, capture_output=True)
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, check=True, capture_output=True, text=True)
    with tarfile.open(next(tmp_path.glob("*.tar.gz"))) as sdist:
        packed = {name.partition("/")[2] for name in sdist.getnames()}
    assert {name for name in listed.stdout.splitlines() if (ROOT / name).exists()} <= packed
