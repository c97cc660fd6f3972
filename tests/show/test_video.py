"""Films of episodes: made without a screen where anything can render, and a clear word where nothing can."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest
from conftest import Finished, random_links
from mujoco import MjData, MjModel, mj_step
from PIL import Image

from metaid.api import episode_objective
from metaid.plant import ArmPlant, MujocoPlant, PlantSettings, load_plant
from metaid.results import candidates_of, read_findings
from metaid.show.scene import in_viewer
from metaid.show.stages import ChainStage
from metaid.store import Store

pytestmark = pytest.mark.slow

Metaid = Callable[..., Finished]


def is_filmed(metaid: Metaid, *arguments: str) -> Finished | None:
    """What was said where a film was made; None where it was not, and the reason was said and no file was left."""
    made = metaid("episode", *arguments)
    path = Path(arguments[arguments.index("--video") + 1])
    if made.status != 0:
        assert "nothing on this machine can render (egl: " in made.err
        assert "install EGL or OSMesa" in made.err
        assert not path.exists()
        assert os.environ.get("METAID_BROWSER") != "required", f"the machine that checks must render: {made.err}"
    return made if made.status == 0 else None


@pytest.fixture(autouse=True)
def no_screen(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a server."""
    for variable in ("DISPLAY", "WAYLAND_DISPLAY", "MUJOCO_GL"):
        monkeypatch.delenv(variable, raising=False)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # imageio-ffmpeg's own pipes
def test_mp4_plays_and_shows_nominal_identified_and_true(metaid: Metaid, studied: Path) -> None:
    """H.264 of the episode's length at 25 frames a second, three panels in which something moves."""
    arguments = ["three-link", "--steps", "400", "--study", "plain", "--storage", str(studied), "--video", "film.mp4"]
    if not is_filmed(metaid, *arguments):
        return
    reader = imageio_ffmpeg.read_frames("film.mp4")
    about = next(reader)
    frames = [np.frombuffer(frame, np.uint8).reshape(*about["size"][::-1], 3) for frame in reader]
    assert about["codec"] == "h264"
    assert len(frames) == pytest.approx(400 * 0.002 * 25, abs=1)
    width = about["size"][0]
    assert width == 3 * (about["size"][1] - 32)
    for panel in range(3):
        part = slice(panel * width // 3, (panel + 1) * width // 3)
        assert frames[0][:, part].std() > 5
        assert np.abs(frames[-1][32:, part].astype(int) - frames[0][32:, part]).max() > 50


def test_film_of_a_study_that_found_nothing_shows_its_best_trial_and_says_so(estimated: Path) -> None:
    """The nominal model is not shown as if it had been identified."""
    store = Store(str(estimated))
    found = read_findings(store, "hidden")
    shown = candidates_of(store, "hidden", found.problem.open_plant())[1]
    assert list(shown) == ["nominal", "best trial", "true"]
    assert (shown["best trial"].vector == found.best_factors * shown["nominal"].vector).all()
    assert (shown["best trial"].vector != shown["nominal"].vector).any()


def test_gif_shows_a_candidate_beside_the_truth_and_holds_a_fall(metaid: Metaid) -> None:
    """Two panels; after its fall the candidate stands still while the truth coasts on."""
    if not is_filmed(metaid, "one-link", "--factor", "gravity_1=0.5", "--steps", "2000", "--video", "film.gif"):
        return
    with Image.open("film.gif") as film:
        assert film.n_frames == 2000 * 0.002 * 10 + 1  # type: ignore[attr-defined]
        frames = []
        for number in (-12, -1):
            film.seek(film.n_frames + number)  # type: ignore[attr-defined]
            frames.append(np.asarray(film.convert("L")).astype(int))
    changed, middle = np.abs(frames[1] - frames[0]) > 60, frames[0].shape[1] // 2
    assert not changed[:, :middle].any()
    assert changed[:, middle:].any()


def test_film_of_an_arm_shows_it_sag_with_the_nominal_law_and_float_with_the_identified_one(
    metaid: Metaid, arms: Path
) -> None:
    """The last panel, of the true arm, is that of the identified one, and not that of the nominal one. The push that
    is asked for beside it is drawn and printed as without a film.
    """
    asked = ["--study", "exact", "--storage", str(arms), "-o", "push.png", "--json"]
    made = is_filmed(metaid, "spatial-three-link", *asked, "--video", "film.gif")
    if not made:
        return
    assert made.out == metaid("episode", "spatial-three-link", "--json").out
    assert Path("push.png").stat().st_size > 0
    with Image.open("film.gif") as film:
        assert film.n_frames == 40  # type: ignore[attr-defined]
        film.seek(39)  # type: ignore[attr-defined]
        last = np.asarray(film.convert("L")).astype(int)[32:]
    nominal, identified, true = np.split(last, 3, axis=1)
    assert (last.max(), last.std() > 5) == (255, True)
    assert np.abs(identified - true).max() < 30
    assert (np.abs(nominal - true) > 60).sum() > 100


def test_film_of_an_arm_needs_its_study(metaid: Metaid, arms: Path) -> None:
    """One line says so, and that a study is about another arm; a study that found nothing shows its best trial."""
    for plant, study, said in (
        ("scara", ["--study", "exact"], "study 'exact' is about the plant spatial-three-link, not about scara"),
        ("scara", [], "--video: plant scara is an arm (allowed of an arm: with --study NAME)"),
    ):
        refused = metaid("episode", plant, *study, "--storage", str(arms), "--video", "film.gif")
        assert (refused.status, refused.out, refused.err.count("\n")) == (2, "", 1)
        assert said in refused.err
    arm = load_plant("spatial-three-link")
    assert isinstance(arm, ArmPlant)
    with closing(Store(str(arms))) as store:
        assert list(candidates_of(store, "bent", arm)[1]) == ["nominal", "best trial", "true"]


def moving_plant(**lacking: float) -> MujocoPlant:
    """A plant with everything that a chain can have, but for what is `lacking`."""
    table = {"damping": 0.02, "frictionloss": 0.03, "stiffness": 0.4} | lacking
    links = [link.model_copy(update=table) for link in random_links(3, seed=4)]
    faults = load_plant("noisy-three-link").settings.faults.model_copy(update={"tilt": 0.05})
    return MujocoPlant("moving", PlantSettings(links=tuple(links), over_compensation=0.1, faults=faults))


def motion(model: MjModel, steps: int = 1000) -> np.ndarray:
    """Joint angles and speeds (2 x njoint) some steps after a random state."""
    data, random = MjData(model), np.random.default_rng(7)
    data.qpos[:], data.qvel[:] = random.normal(size=(2, model.nv))
    for _ in range(steps):
        mj_step(model, data)
    return np.array([data.qpos, data.qvel])


@pytest.mark.parametrize("lacking", [{}, {"frictionloss": 0.0}, {"damping": 0.0}, {"stiffness": 0.0}])
def test_viewers_model_moves_as_the_plant_does(lacking: dict[str, float]) -> None:
    """To the last bit, with friction, springs, a declared fault and a tilted base: what is drawn weighs nothing."""
    plant = moving_plant(**lacking)
    assert (motion(in_viewer(plant)[0]) == motion(plant.model)).all()


def test_each_part_of_the_motion_is_seen_in_the_viewer() -> None:
    """Damping, dry friction, springs, the declared fault and the tilt each change how the viewer's model moves."""
    plant = moving_plant()
    whole = motion(in_viewer(plant)[0], 200)
    for name in ("damping", "frictionloss", "stiffness"):
        assert np.abs(motion(in_viewer(moving_plant(**{name: 0.0}))[0], 200) - whole).max() > 1e-3, name
    for change in ({"over_compensation": 0.0}, {"faults": plant.settings.faults.model_copy(update={"tilt": 0.0})}):
        other = MujocoPlant("other", plant.settings.model_copy(update=change))
        assert np.abs(motion(in_viewer(other)[0], 200) - whole).max() > 1e-3, change


@pytest.mark.parametrize("faults", [{"delay": 10}, {"tilt": 0.2}, {"angle_noise": 0.01, "push_noise": 0.1}])
def test_film_shows_the_episode_of_the_table(faults: dict[str, float]) -> None:
    """Faults and noise included: a panel ends in the fall that the table has, and holds its readings."""
    settings = load_plant("one-link").settings
    plant = MujocoPlant("faulty", settings.model_copy(update={"faults": settings.faults.model_copy(update=faults)}))
    objective = episode_objective(plant, 1000)
    for factor in (0.9, 1.1):
        factors = np.array([factor])
        shown = ChainStage(objective).motion(objective.nominal.scaled(factors), "candidate", rate=100)
        table = objective.summary(factors)
        assert shown.caption == ("candidate: falls" if table["fell"] else "candidate")
        seen = objective.watch(factors)[1].angles[::5]  # a frame every 5 steps of 2 ms
        assert (shown.angles == seen).all()
        if table["fell"]:
            assert len(shown.angles) == table["fall_step"] // 5 + 1


def test_where_nothing_renders_it_is_said_at_once(tmp_path: Path) -> None:
    """One line that names what was tried and what to install, status 2, no traceback."""
    command = "from metaid.cli import main; main()"
    program = [sys.executable, "-c", command, "episode", "one-link", "--steps", "50", "--video", "film.mp4"]
    environment = {**os.environ, "MUJOCO_GL": "glfw"}
    tried = subprocess.run(program, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert tried.returncode == 2
    assert "nothing on this machine can render (glfw: " in tried.stderr
    assert tried.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
