"""Films of episodes: made without a screen where anything can render, and a clear word where nothing can."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest
from conftest import Finished
from PIL import Image

Metaid = Callable[..., Finished]


def filmed(metaid: Metaid, *arguments: str) -> bool:
    """Whether a film was made; where it was not, that the reason was said and no file was left."""
    made = metaid("episode", *arguments)
    path = Path(arguments[arguments.index("--video") + 1])
    if made.status != 0:
        assert "nothing on this machine can render (egl: " in made.err
        assert "install EGL or OSMesa" in made.err
        assert not path.exists()
        assert os.environ.get("METAID_BROWSER") != "required", f"the machine that checks must render: {made.err}"
    return made.status == 0


@pytest.fixture(autouse=True)
def no_screen(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a server."""
    for variable in ("DISPLAY", "WAYLAND_DISPLAY", "MUJOCO_GL"):
        monkeypatch.delenv(variable, raising=False)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # imageio-ffmpeg's own pipes
def test_mp4_plays_and_shows_nominal_identified_and_true(metaid: Metaid, studied: Path) -> None:
    """H.264 of the episode's length at 25 frames a second, three panels in which something moves."""
    arguments = ["three-link", "--steps", "400", "--study", "plain", "--storage", str(studied), "--video", "film.mp4"]
    if not filmed(metaid, *arguments):
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


def test_gif_shows_a_candidate_beside_the_truth_and_holds_a_fall(metaid: Metaid) -> None:
    """Two panels; after its fall the candidate stands still while the truth coasts on."""
    if not filmed(metaid, "one-link", "--factor", "gravity_1=0.5", "--steps", "2000", "--video", "film.gif"):
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


def test_rich_model_moves_as_the_lean_one() -> None:
    """The bodies that are drawn weigh nothing: masses, inertias and motion are the searched plant's."""
    import mujoco

    from metaid.plant.loading import load_plant
    from metaid.show.scene import scene

    plant = load_plant("three-link")
    rich = scene(plant.chain, plant.gravity, plant.timestep)
    data = mujoco.MjData(rich)
    data.qvel[:] = plant.data.qvel[:] = [0.3, -0.2, 0.5]
    for _ in range(200):
        mujoco.mj_step(rich, data)
        plant.step()
    assert data.qpos == pytest.approx(plant.data.qpos, rel=1e-9)


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
