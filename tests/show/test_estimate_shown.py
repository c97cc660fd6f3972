"""The estimate in the report, the dashboard's note and the figures; and that nothing is shown where none was found."""

from __future__ import annotations

import functools
import itertools
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import metaid as package
from metaid import figures
from metaid.show import dashboard, report

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("few_candidates")]

UNEXPLAINED = "the model does not explain what was seen"


@functools.cache
def words(name: str, estimated: Path) -> str:
    """What the report says beside its figures, which are not drawn, and its files."""
    found = package.load_findings(name, str(estimated))
    shown = report.page(found, figures.Gallery(found), [])
    text = re.sub(r"<style.*?</style>|<svg.*?</svg>|<pre.*?</pre>", "", shown, flags=re.DOTALL)
    return " ".join(re.sub("<[^>]+>", " ", text).split())


def note(name: str, estimated: Path) -> str:
    """The dashboard's note."""
    return dashboard.note(package.load_findings(name, str(estimated)))


@pytest.mark.parametrize(
    ("shown", "name", "which"),
    [
        (words, "matched", "all 2 trials"),
        (note, "matched", "all 2 trials"),
        (note, "searched", "the first 12 trials"),
    ],
)
def test_report_and_note_show_the_estimate_with_its_intervals(
    shown: Callable[[str, Path], str], name: str, which: str, estimated: Path
) -> None:
    """All nine lumps once, from how many trials, what the misfit means, and that low to high is an interval."""
    text = shown(name, estimated)
    assert f"Estimate from {which}: the model explains what was seen: misfit " in text
    assert "ow and high are the 95 % interval" in text
    for lump in package.study(name, str(estimated)).estimate.to_dict("records"):
        assert lump["name"] in text
        assert f"{lump['identified']:.5g}" in text


def test_report_says_what_the_lumps_leave_open_of_the_links(estimated: Path) -> None:
    """A table of masses, centres of mass, inertias and lengths where an estimate found lumps, and else none."""
    page = words("matched", estimated)
    assert "What the lumps say of the links" in page
    assert re.search(r"mass_1 [\d.]+ [\d.]+ unbounded [\d.]+ kg", page)
    assert "known to a tenth: length_1, length_2." in page
    assert "What the lumps say of the links" not in words("hidden-searched", estimated)


def test_report_and_note_show_no_lump_of_an_estimate_that_explains_nothing(estimated: Path) -> None:
    """The verdict comes first and says why; no interval, no number of any lump, no error."""
    page, notes = words("hidden-searched", estimated), [note(name, estimated) for name in ("hidden", "hidden-searched")]
    assert re.search(r"Not found\. .*[Tt]he model does not explain what was seen", page[:700])
    for text in notes:
        assert re.search(r"\*\*Verdict: not found\.\*\* .*the model does not explain what was seen", text)
    for text in (page, *notes):
        assert UNEXPLAINED in text
        assert "95 %" not in text
        shown = re.findall(r"gravity_\d`? \|? ?([\d.]+) ?\|? (\S+)", text)
        assert [identified for _, identified in shown][:3] == (["not"] * 3 if text is page else ["–"] * 3)
    assert "The largest error" not in page
    assert "every lump within" not in page


def test_correlation_of_an_estimate_is_that_of_its_covariance(estimated: Path) -> None:
    """Ones on the diagonal, symmetric, with the lumps' names."""
    found = package.load_findings("matched", str(estimated)).estimate
    assert found is not None
    axes = figures.plot_covariance(found, Figure().subplots())
    matrix = np.asarray(axes.images[0].get_array())
    assert np.diag(matrix) == pytest.approx(1.0)
    assert matrix == pytest.approx(matrix.T)
    assert [tick.get_text() for tick in axes.get_yticklabels()] == list(found.estimate.names)


def test_motion_of_a_push_is_the_plants_in_dots_and_the_twins_in_lines(estimated: Path) -> None:
    """A line and dots a joint, in degrees; the difference is that of both in mrad."""
    found = package.load_findings("noisy", str(estimated)).estimate
    assert found is not None
    replay = found.replay(1)
    axes = figures.plot_motion(replay, 4, Figure().subplots())
    lines = axes.get_lines()[:6]
    for joint, (dots, line) in enumerate(zip(lines[::2], lines[1::2], strict=True)):
        assert np.array_equal(dots.get_ydata(), np.degrees(replay.seen[4, :, joint]))
        assert np.array_equal(line.get_ydata(), np.degrees(replay.simulated[4, :, joint]))
        assert (dots.get_linestyle(), line.get_marker()) == ("None", "None")
    assert {"joint 1", "joint 2", "joint 3", "plant", "twin"} == set(axes.get_legend_handles_labels()[1])
    dots, *_, low, high = figures.plot_difference(replay, 4, Figure().subplots()).get_lines()
    assert dots.get_ydata() == pytest.approx(1e3 * (replay.simulated - replay.seen)[4, :, 0])
    assert high.get_ydata()[0] == -low.get_ydata()[0] == pytest.approx(1.96, rel=0.02)  # noise of 1 mrad


@pytest.mark.parametrize("name", ["noisy", "hidden"])
def test_trial_that_is_drawn_is_the_first_or_else_the_one_that_the_twin_shows_worst(name: str, estimated: Path) -> None:
    """Where the model does not explain what was seen, it is the one with the largest residuals."""
    found = package.load_findings(name, str(estimated)).estimate
    assert found is not None
    assert found.explains == (name == "noisy")
    worst = int(np.argmax([np.sqrt((table**2).mean()) for table in found.estimate.residuals]))
    drawn = 0 if name == "noisy" else worst
    for number in range(found.trials):
        is_drawn = np.array_equal(found.replay().seen, found.replay(number).seen, equal_nan=True)
        assert is_drawn == (number == drawn)


@pytest.fixture(scope="module")
def gallery(estimated: Path) -> figures.Gallery:
    """The figures of a noisy study, for which candidates are simulated once."""
    return figures.Gallery(package.load_findings("noisy", str(estimated)))


@pytest.mark.parametrize("width", ["page", "column"])
def test_figures_of_a_noisy_study_lie_within_their_width(gallery: figures.Gallery, width: str) -> None:
    """Nothing of the motion, the residuals, the correlation and the shrinking intervals is cut off."""
    shown = [gallery.picture(name, width).figure for name in gallery.makers if name.startswith("estimate-")]
    assert len(shown) == 4
    for figure in shown:
        with figures.style(), figures.laid_out(figure, "svg"):
            box = figure.get_tightbbox()
        assert box.x0 > -0.05
        assert box.x1 < figure.get_figwidth() + 0.05


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
    """At most seven numbers of trials, from the first to all of them."""
    findings = package.load_findings("searched", str(estimated))
    found = findings.estimate
    assert found is not None
    robot = findings.problem.robot
    axes = figures.plot_growth(found, robot.true_values(robot.estimated), Figure().subplots())
    deviations, errors = axes.get_lines()
    assert len(deviations.get_xdata()) <= 7
    assert deviations.get_xdata()[-1] == found.trials == 12
    drawn = np.asarray(deviations.get_ydata(), dtype=float)
    assert (np.diff(drawn) < 0.0).all()
    assert drawn[-1] == pytest.approx(100.0 * found.estimate.deviations.max(), rel=1e-3)
    assert np.asarray(errors.get_ydata(), dtype=float).max() < 1e-6


def test_model_that_explains_nothing_has_residuals_but_no_intervals_to_draw(estimated: Path) -> None:
    """And its motion beside the plant's; no correlation of what was not found, and no shrinking intervals."""
    names = {each.name for each in figures.Gallery(package.load_findings("hidden", str(estimated))).pictures()}
    assert {"estimate-motion", "estimate-residuals"} <= names
    assert not {"estimate-correlation", "estimate-trials", "ranges"} & names


def test_study_without_falls_has_figures_of_full_height_and_no_legend_of_falls(
    estimated: Path, recwarn: pytest.WarningsRecorder
) -> None:
    """A mark of no falls would have the layout make room for it; a legend would name what is not there."""
    found = package.load_findings("matched", str(estimated))
    assert found.falls.empty
    for picture in itertools.islice(figures.Gallery(found).pictures("column"), 2):
        picture.figure.draw_without_rendering()
        height = max(axes.get_position().height for axes in picture.figure.axes)
        assert height > 0.1, picture.name
        texts = [text.get_text() for legend in picture.figure.legends for text in legend.get_texts()]
        texts += [text for axes in picture.figure.axes for text in axes.get_legend_handles_labels()[1]]
        assert not [text for text in texts if text.startswith("fall")], picture.name
    for plot in (
        figures.plot_parallel,
        functools.partial(figures.plot_boundary, first="gravity_1", second="gravity_2"),
    ):
        axes = plot(found, axes=Figure().subplots())
        assert "fall" not in axes.get_legend_handles_labels()[1]
    assert not [warning for warning in recwarn if "legend" in str(warning.message)]
