"""The estimate in the report, the dashboard's note and the figures; and that nothing is shown where none was found."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import metaid as package
from metaid import figures
from metaid.show import dashboard
from metaid.show.report import render

NOT_FOUND = "NOT FOUND: the model does not explain what was seen: misfit "


def words(name: str, estimated: Path) -> tuple[str, str]:
    """What the report says beside its figures and files, and the dashboard's note."""
    found = package.load_findings(name, str(estimated))
    page = re.sub(r"<style.*?</style>|<svg.*?</svg>|<pre.*?</pre>", "", render(found), flags=re.DOTALL)
    return " ".join(re.sub("<[^>]+>", " ", page).split()), dashboard.note(found)


@pytest.mark.parametrize("name", ["matched", "searched"])
def test_report_and_note_show_the_estimate_with_its_intervals(name: str, estimated: Path) -> None:
    """All nine lumps once, from how many trials, what the misfit means, and that low to high is an interval."""
    which = {"matched": "all 2 trials", "searched": "the first 32 trials"}[name]
    for text in words(name, estimated):
        assert f"Estimate from {which}: the model explains what was seen: misfit " in text
        assert "ow and high are the 95 % interval" in text
        for lump in package.estimate(name, str(estimated)).to_dict("records"):
            assert lump["name"] in text
            assert f"{lump['identified']:.5g}" in text


@pytest.mark.parametrize("name", ["hidden", "hidden-searched"])
def test_report_and_note_show_no_lump_of_an_estimate_that_explains_nothing(name: str, estimated: Path) -> None:
    """They say that it was not found and why; no interval, no error of it, no inertia lump."""
    for text in words(name, estimated):
        assert NOT_FOUND in text
        assert "95 %" not in text
        shown = re.findall(r"inertia_\d`? \|? ?([\d.]+) ?\|? (\S+)", text)
        assert [identified for _, identified in shown] == (["–"] * 3 if name == "hidden" else [])
    if name == "hidden":
        page, _ = words(name, estimated)
        assert "The largest error" not in page
        assert "every lump within" not in page
        assert "not found: the model does not explain what was seen" in page


def test_correlation_of_an_estimate_is_that_of_its_covariance(estimated: Path) -> None:
    """Ones on the diagonal, symmetric, with the lumps' names."""
    found = package.load_findings("matched", str(estimated)).estimate
    assert found is not None
    axes = figures.plot_covariance(found, Figure().subplots())
    matrix = np.asarray(axes.images[0].get_array())
    assert np.diag(matrix) == pytest.approx(1.0)
    assert matrix == pytest.approx(matrix.T)
    assert [tick.get_text() for tick in axes.get_yticklabels()] == list(found.estimate.names)


def test_residuals_have_a_cell_for_each_push_and_joint(estimated: Path) -> None:
    """Where the model explains nothing they lie far above what it may leave, and the scale says what that is."""
    found = package.load_findings("hidden", str(estimated)).estimate
    assert found is not None
    axes = figures.plot_residuals(found, Figure().subplots())
    shown = np.asarray(axes.images[0].get_array())
    assert shown.shape == (3, 6)
    assert shown.max() > 1e3
    assert "explained: below 3" in axes.figure.axes[1].get_ylabel()


def test_deviation_shrinks_with_every_trial_and_ends_at_the_estimate(estimated: Path) -> None:
    """At most twelve numbers of trials, from the first to all of them."""
    findings = package.load_findings("searched", str(estimated))
    found = findings.estimate
    assert found is not None
    truth = findings.problem.open_plant().true_lumps()
    assert truth is not None
    axes = figures.plot_growth(found, truth.vector_of(found.experiment.unknowns.searched), Figure().subplots())
    deviations, errors = axes.get_lines()
    assert len(deviations.get_xdata()) <= 12
    assert deviations.get_xdata()[-1] == found.trials == 32
    drawn = np.asarray(deviations.get_ydata(), dtype=float)
    assert (np.diff(drawn) < 0.0).all()
    assert drawn[-1] == pytest.approx(100.0 * found.estimate.deviations.max(), rel=1e-3)
    assert np.asarray(errors.get_ydata(), dtype=float).max() < 1e-6


def test_model_that_explains_nothing_has_residuals_but_no_intervals_to_draw(estimated: Path) -> None:
    """No correlation of what was not found, and no shrinking intervals."""
    names = {each.name for each in figures.Gallery(package.load_findings("hidden", str(estimated))).pictures()}
    assert "estimate-residuals" in names
    assert not {"estimate-correlation", "estimate-trials", "ranges"} & names
