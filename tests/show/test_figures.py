"""Figures of real studies: what is drawn, how it is labelled, and that it can be written."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from conftest import Finished
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from PIL import Image

from metaid import figures, load_findings, load_plant
from metaid.cli import main
from metaid.episode import run_stepwise
from metaid.errors import StorageError
from metaid.results import Findings, plane, sweep

pytestmark = pytest.mark.usefixtures("few_candidates")

Metaid = Callable[..., Finished]
FILES = {"convergence", "factors", "ranges", "frequency", "boundary", "parallel", "correlation", "episode", "tracking"}
FILES |= {"estimate-motion", "estimate-residuals", "estimate-correlation", "estimate-trials"}
OF_SEVERAL_LUMPS = {"boundary", "parallel", "correlation"}


@pytest.fixture
def axes() -> Axes:
    """An empty Axes of no window."""
    return Figure().subplots()


@pytest.fixture(scope="module")
def plain(studied: Path) -> Findings:
    """Three links, plain coordinates, some falls."""
    return load_findings("plain", str(studied))


@pytest.fixture(scope="module")
def boundary(studied: Path) -> Findings:
    """Two links, random candidates, half of them falls."""
    return load_findings("boundary", str(studied))


@pytest.fixture(scope="module")
def counted(studied: Path) -> Findings:
    """One link, whole periods."""
    return load_findings("counted", str(studied))


def line(axes: Axes, label: str) -> Line2D:
    """The one line of that label."""
    (found,) = [each for each in axes.get_lines() if each.get_label() == label]
    return found


@pytest.mark.slow
def test_convergence_draws_the_best_so_far_and_marks_every_fall(plain: Findings, axes: Axes) -> None:
    """A step line that never rises, a mark a fall, the measure with its unit."""
    assert figures.plot_convergence(plain, axes) is axes
    best = np.asarray(line(axes, "best so far").get_ydata(), dtype=float)
    assert best[-1] == plain.summary["best"]["value"]
    assert (np.diff(best) <= 0).all()
    marks = line(axes, f"fall ({len(plain.falls)})")
    assert np.array_equal(marks.get_xdata(), plain.falls["number"])
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("trial", "frequency, Hz")


@pytest.mark.slow
def test_convergence_of_counts_says_periods(counted: Findings, axes: Axes) -> None:
    """A count has no unit of Hz, and zero is drawn."""
    figures.plot_convergence(counted, axes)
    assert axes.get_ylabel() == "whole periods"
    assert axes.get_yscale() == "linear"


def test_error_ends_at_the_error_of_the_best(plain: Findings, axes: Axes) -> None:
    """In percent, the largest of all lumps."""
    figures.plot_error(plain, axes)
    errors = np.asarray(axes.get_lines()[0].get_ydata(), dtype=float)
    assert errors[-1] == pytest.approx(100 * plain.summary["best"]["max_error"])
    assert axes.get_ylabel() == "largest lump error, %"


def test_factor_draws_survivors_falls_and_the_truth(plain: Findings, axes: Axes) -> None:
    """Every trial is there, in a colour and a mark of its kind."""
    figures.plot_factor(plain, "coriolis_1_3", axes)
    survivors, falls = line(axes, "survivor"), line(axes, "fall")
    assert np.array_equal(survivors.get_ydata(), plain.survivors["coriolis_1_3"])
    assert np.array_equal(falls.get_ydata(), plain.falls["coriolis_1_3"])
    assert survivors.get_marker() != falls.get_marker()
    assert {to_hex(survivors.get_color()), to_hex(falls.get_color())} == {"#0072b2", "#d55e00"}
    true = plain.lumps.set_index("name")["true"] / plain.lumps.set_index("name")["nominal"]
    assert line(axes, "truth").get_ydata()[0] == pytest.approx(true["coriolis_1_3"])
    with pytest.raises(StorageError, match="unknown lump 'coriolis_3_1'"):
        figures.plot_factor(plain, "coriolis_3_1", axes)


def test_boundary_has_the_truth_on_the_edge_of_falling(boundary: Findings, axes: Axes) -> None:
    """Falls lie on one side, survivors on the other, and beyond the truth candidates fall."""
    true, low, high = boundary.true_factors, 0.8, 1.2
    assert true is not None
    grids = np.linspace(low, high, 9), np.linspace(low, high, 9)
    around = plane(boundary.problem.make_objective(), true * 1.001, (0, 1), *grids)
    figures.plot_boundary(boundary, "gravity_1", "gravity_2", axes, around)
    assert line(axes, "truth").get_xdata()[0] == true[0]
    fell = around.fell
    assert fell[:, grids[0] < true[0] - 0.02].all()
    assert not fell[np.ix_(grids[1] > true[1] + 0.02, grids[0] > true[0] + 0.02)].any()
    assert np.array_equal(line(axes, "fall").get_xdata(), boundary.falls["gravity_1"])
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("factor of gravity_1", "factor of gravity_2")


def test_plane_is_where_each_candidate_falls_also_where_none_was_evaluated(boundary: Findings) -> None:
    """Row by row as the sweeps have it."""
    true, objective, factors = boundary.true_factors, boundary.problem.make_objective(), np.linspace(0.8, 1.2, 13)
    assert true is not None
    rows = [sweep(objective, np.array([true[0], each, *true[2:]]), 0, factors).fell for each in factors]
    assert np.array_equal(plane(objective, true, (0, 1), factors, factors).fell, rows)
    assert 0.1 < np.mean(rows) < 0.9


def test_sweep_is_the_papers_first_table_as_a_curve(counted: Findings, axes: Axes) -> None:
    """Whole periods grow with the factor from the truth on, and below it the pendulum falls."""
    factors = np.linspace(0.6, 1.6, 21)
    swept = sweep(counted.problem.make_objective(), counted.best_factors, 0, factors)
    figures.plot_sweep(counted, swept, axes)
    true = counted.true_factors
    assert true is not None
    assert np.array_equal(swept.fell, factors < true[0])
    assert (np.diff(swept.values[~swept.fell]) >= 0).all()
    assert np.array_equal(line(axes, "count").get_ydata(), swept.values, equal_nan=True)
    assert axes.get_ylabel() == "whole periods"
    assert "falls" in axes.get_legend_handles_labels()[1]


def test_parallel_coordinates_colour_by_frequency(plain: Findings, axes: Axes) -> None:
    """The best trial is among the lines, at the dark end; the colour bar has the unit."""
    figures.plot_parallel(plain, axes)
    drawn = [each for each in axes.collections if isinstance(each, LineCollection) and each.get_array() is not None]
    values = np.asarray(drawn[0].get_array())
    assert values.min() == plain.summary["best"]["value"]
    assert [tick.get_text() for tick in axes.get_xticklabels()] == plain.names
    assert axes.figure.axes[1].get_ylabel() == "frequency, Hz"


def test_ranges_are_those_of_the_table(plain: Findings, axes: Axes) -> None:
    """A bar from low to high, in percent of the identified value."""
    figures.plot_ranges(plain, axes)
    lumps = plain.known_lumps
    widths = [bar.get_width() for bar in axes.patches]
    assert widths == pytest.approx((100 * (lumps["high"] - lumps["low"]) / lumps["identified"]).tolist())
    assert axes.get_xlabel() == "deviation from the identified value, %"
    left, right = axes.get_xlim()
    assert all(left < bar.get_x() and bar.get_x() + bar.get_width() < right for bar in axes.patches)


def test_correlation_is_symmetric_and_labelled(plain: Findings, axes: Axes) -> None:
    """Ones on the diagonal, the lumps' names on both sides."""
    figures.plot_correlation(plain, axes)
    matrix = np.asarray(axes.images[0].get_array())
    assert np.diag(matrix) == pytest.approx(1.0)
    assert matrix == pytest.approx(matrix.T)
    assert [tick.get_text() for tick in axes.get_yticklabels()] == plain.names


def test_angles_and_phase_portrait_are_the_episodes_in_degrees(plain: Findings, axes: Axes) -> None:
    """Degrees over seconds, and degrees per second over degrees."""
    objective = plain.problem.make_objective()
    _, trajectory = run_stepwise(objective.plant, objective.nominal.scaled(plain.best_factors), objective.episode)
    figures.plot_angles(trajectory, 0.002, axes)
    assert np.asarray(line(axes, "joint 2").get_ydata()) == pytest.approx(np.degrees(trajectory.angles[:, 1]))
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("time, s", "joint angle, degrees")
    phase = figures.plot_phase(trajectory, Figure().subplots())
    assert np.asarray(line(phase, "joint 1").get_ydata()) == pytest.approx(np.degrees(trajectory.speeds[:, 0]))
    assert (phase.get_xlabel(), phase.get_ylabel()) == ("joint angle, degrees", "joint speed, degrees/s")


@pytest.mark.parametrize("name", ["one-link", "three-link", "ten-link"])
def test_sketch_has_every_link_to_scale_with_its_numbers(name: str, axes: Axes) -> None:
    """Joints a link length apart; length, mass, centre of mass and inertia beside each."""
    plant = load_plant(name)
    figures.plot_plant(plant, axes)
    texts = " ".join(text.get_text() for text in axes.texts)
    rod = max(axes.get_lines(), key=lambda each: each.get_linewidth())
    joints = np.stack([rod.get_xdata(), rod.get_ydata()], axis=-1)
    assert np.linalg.norm(np.diff(joints, axis=0), axis=1) == pytest.approx(plant.chain.length)
    for i in range(plant.njoint):
        assert f"link {i + 1}: length {plant.chain.length[i]:.3g} m, mass {plant.chain.mass[i]:.3g} kg" in texts
    assert "g = 9.81 m/s²" in texts


@pytest.fixture(scope="module")
def gallery(plain: Findings) -> figures.Gallery:
    """Its figures, for which candidates are simulated once."""
    return figures.Gallery(plain)


@pytest.mark.slow
@pytest.mark.parametrize("width", ["page", "column"])
def test_every_figure_is_as_wide_as_a_page_or_a_column(gallery: figures.Gallery, width: str) -> None:
    """Nothing is cut off at either size: all that is drawn lies within the figure."""
    inches = {"page": 7.0, "column": 3.5}[width]
    seen = set()
    for picture in gallery.pictures(width):
        seen.add(picture.name)
        assert picture.figure.get_figwidth() <= inches
        assert picture.caption.endswith(".")
        with figures.style(), figures.laid_out(picture.figure, "svg"):
            box = picture.figure.get_tightbbox()
        assert box.x0 > -0.05
        assert box.x1 < picture.figure.get_figwidth() + 0.05
    assert seen == FILES


@pytest.fixture(scope="module")
def plots(studied: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, str], Path]:
    """Where the command plots a study in a format; what it has plotted it does not plot again."""

    @functools.cache
    def plot(study: str, ending: str) -> Path:
        folder = tmp_path_factory.mktemp("plots") / "figures"
        with pytest.raises(SystemExit) as stop:
            main(["study", "plot", study, "--storage", str(studied), "-o", str(folder), "--format", ending])
        assert not stop.value.code
        return folder

    return plot


@pytest.mark.slow
@pytest.mark.parametrize(
    ("study", "names", "ending", "starts"),
    [
        ("counted", FILES - OF_SEVERAL_LUMPS, "svg", b"<?xml"),
        ("boundary", FILES, "png", b"\x89PNG"),
        ("counted", FILES - OF_SEVERAL_LUMPS, "pdf", b"%PDF"),
    ],
    ids=["svg", "png", "pdf"],
)
def test_plot_writes_every_figure(
    plots: Callable[[str, str], Path], study: str, names: set[str], ending: str, starts: bytes
) -> None:
    """A file a figure, in the format asked for."""
    written = list(plots(study, ending).iterdir())
    assert {path.stem for path in written} == names
    assert all(path.suffix == f".{ending}" and path.read_bytes().startswith(starts) for path in written)


@pytest.mark.slow
def test_plot_twice_writes_the_same_bytes(metaid: Metaid, studied: Path, plots: Callable[[str, str], Path]) -> None:
    """No date, no random name: a figure under version control changes when the study does."""
    metaid("study", "plot", "counted", "--storage", str(studied), "-o", "again", "--format", "svg")
    for path in plots("counted", "svg").iterdir():
        assert path.read_bytes() == (Path("again") / path.name).read_bytes()


@pytest.mark.parametrize("suffix", [".png", ".svg"])
def test_saved_figure_is_as_it_was_and_its_file_is_that_of_matplotlib(
    plain: Findings, suffix: str, tmp_path: Path
) -> None:
    """With the layout for that file, whatever its user has for figures; it is laid out anew for the next one."""
    with figures.style():
        figure = Figure(figsize=(figures.COLUMN, 2.0), layout="constrained")
        figures.plot_convergence(plain, figure.subplots())
        before = figure.get_layout_engine(), figure.canvas, figure.dpi
        with mpl.rc_context({"figure.autolayout": True}):
            figures.save(figure, tmp_path / f"ours{suffix}")
        assert (figure.get_layout_engine(), figure.canvas, figure.dpi) == before
        undated = {"Date": None} if suffix == ".svg" else None
        figure.savefig(tmp_path / f"theirs{suffix}", dpi=200, metadata=undated)
    ours, theirs = ((tmp_path / f"{name}{suffix}").read_bytes() for name in ("ours", "theirs"))
    assert ours == theirs


def test_plant_draw_writes_a_picture(metaid: Metaid) -> None:
    """A PNG that is not blank."""
    assert metaid("plant", "draw", "three-link", "-o", "plant.png").status == 0
    low, high = Image.open("plant.png").convert("L").getextrema()
    assert low < 60 < 240 < high


MISTAKES = {
    "plot of a study that is not there": (
        ["study", "plot", "nix", "-o", "f", "--storage", "DB"],
        "unknown study 'nix'",
    ),
    "plot over a lump that is not there": (
        ["study", "plot", "plain", "-o", "f", "--storage", "DB", "--over", "gravity_1", "gravity_9"],
        "unknown lump 'gravity_9'",
    ),
    "plot over a lump and itself": (
        ["study", "plot", "plain", "-o", "f", "--storage", "DB", "--over", "gravity_1", "gravity_1"],
        "two different lumps",
    ),
    "plot into no folder": (["study", "plot", "counted", "-o", "no/f", "--storage", "DB"], "No such file or directory"),
    "plot of unknown format": (["study", "plot", "plain", "-o", "f", "--format", "bmp"], "'png', 'svg', 'pdf'"),
    "sketch of unknown format": (["plant", "draw", "one-link", "-o", "p.bmp"], "allowed: .png, .pdf, .svg"),
    "sketch of no plant": (["plant", "draw", "on-link", "-o", "p.png"], "did you mean 'one-link'?"),
    "report of unknown format": (["study", "report", "plain", "-o", "r.pdf", "--storage", "DB"], "allowed: .html"),
    "report of a study without trials": (["study", "report", "empty", "-o", "r.html"], "no survivor yet"),
    "plot of a study without trials": (["study", "plot", "empty", "-o", "f"], "no survivor yet"),
    "video of unknown format": (["episode", "one-link", "--video", "v.avi"], "allowed: .mp4, .gif"),
    "study without a video": (["episode", "one-link", "--study", "plain"], "it needs --video"),
    "video of another plant's study": (
        ["episode", "one-link", "--study", "plain", "--video", "v.gif", "--storage", "DB"],
        "is about the plant three-link",
    ),
    "video where nothing renders": (
        ["episode", "one-link", "--video", "v.gif", "--steps", "50"],
        "nothing on this machine can render",
    ),
    "viewer without a screen": (["plant", "view", "one-link"], "there is no screen here"),
    "dashboard of no DB": (["dashboard", "--storage", "nix.db"], "no study DB at nix.db"),
    "dashboard at no port": (["dashboard", "--port", "99999"], "--port"),
}


@pytest.mark.slow
@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistake_is_answered_in_one_line_with_status_2_and_nothing_written(
    metaid: Metaid, studied: Path, monkeypatch: pytest.MonkeyPatch, mistake: str
) -> None:
    """As everywhere: what is wrong, what is allowed, no file."""
    for variable in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setenv("MUJOCO_GL", "nix")
    metaid("study", "create", "one-link-count", "--name", "empty")
    before = {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()}
    arguments, message = MISTAKES[mistake]
    answered = metaid(*(str(studied) if argument == "DB" else argument for argument in arguments))
    assert answered.status == 2
    assert message in answered.err
    assert answered.err.count("\n") == 1
    assert {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()} == before


@pytest.mark.slow
def test_a_lump_that_is_not_identified_is_left_out_of_the_error(plain: Findings) -> None:
    """Where the table says nothing of a lump, the error and the film keep to those that it tells."""
    untold = plain.lumps["name"].str.startswith("coriolis")
    lumps = plain.lumps.copy()
    lumps.loc[untold, ["factor", "identified", "low", "high", "error"]] = np.nan
    found = dataclasses.replace(plain, lumps=lumps)
    assert plain.true_factors is not None
    gravity = np.abs(plain.best_factors / plain.true_factors - 1.0)[~untold].max()
    assert found.errors(found.bests)[-1] == pytest.approx(gravity)
    assert np.array_equal(found.identified_factors == 1.0, untold)
    assert {picture.name for picture in figures.Gallery(found).pictures()} == FILES
