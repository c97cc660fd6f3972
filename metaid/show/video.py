"""Moving pictures of an episode, without a screen: panels side by side after the same push.

Frames come from a child process (`metaid.rendering`), with EGL or else OSMesa unless MUJOCO_GL says which.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from metaid.episode import Episode, run_stepwise
from metaid.errors import RenderError, optional_packages
from metaid.models import Array, Lumps
from metaid.plant import MujocoPlant
from metaid.show.rendering import write_job

with optional_packages("video"):
    import imageio_ffmpeg
    import OpenGL  # noqa: F401, the child process needs it
    from PIL import Image, ImageDraw, ImageFont

SUFFIXES = (".mp4", ".gif")
RATES = {".mp4": 25, ".gif": 10}  # frames per second
SIZES = {".mp4": 384, ".gif": 240}  # pixels, of each square panel
LONGEST_FILM = 20.0  # s of motion that are shown at most
BACKENDS = ("egl", "osmesa")
CAPTION = 32  # pixels above the panels
Frame = NDArray[np.uint8]


def film(plant: MujocoPlant, candidates: Mapping[str, Lumps], episode: Episode, path: Path) -> None:
    """Writes what the plant does after the last push of `episode` when compensated by each of the `candidates`, which
    are named by their captions, in real time.

    The file's ending says the format.  Raises RenderError where nothing here can render.
    """
    rate, size = RATES[path.suffix], SIZES[path.suffix]
    panels, captions = [], []
    for caption, lumps in candidates.items():
        record, trajectory = run_stepwise(plant, lumps, episode)
        steps = np.arange(
            0.0, min(len(trajectory.angles), LONGEST_FILM / plant.timestep), 1.0 / (rate * plant.timestep)
        )
        panels.append(trajectory.angles[steps.astype(int)])
        captions.append(f"{caption}: falls" if record.fall_step is not None else caption)
    length = max(len(panel) for panel in panels)
    # A panel that fell stands still at its last frame while the others go on.
    angles = np.array([np.vstack([panel, np.repeat(panel[-1:], length - len(panel), axis=0)]) for panel in panels])
    heading = _heading(captions, size)
    frames = (np.vstack([heading, frame]) for frame in _render(plant, angles, size))
    (_write_gif if path.suffix == ".gif" else _write_mp4)(frames, path, rate)


def _heading(captions: list[str], size: int) -> Frame:
    image = Image.new("RGB", (size * len(captions), CAPTION), "white")
    pen, font = ImageDraw.Draw(image), ImageFont.load_default(size // 16)
    for i, caption in enumerate(captions):
        pen.text((size * (i + 0.5), CAPTION / 2), caption, fill="black", font=font, anchor="mm")
    return np.asarray(image)


def _render(plant: MujocoPlant, angles: Array, size: int) -> Iterator[Frame]:
    """Frames of joint `angles` (npanel x nframe x njoint) from the first OpenGL that works."""
    asked = os.environ.get("MUJOCO_GL")
    complaints = []
    shape = (size, size * len(angles), 3)
    with tempfile.TemporaryDirectory() as folder:
        job = Path(folder) / "job.npz"
        write_job(job, plant.chain, angles, size)
        for backend in [asked] if asked else BACKENDS:
            with _Child(job, backend) as child:
                frame = child.read(int(np.prod(shape)))
                if frame is None:
                    complaints.append(f"{backend}: {child.complaint()}")
                    continue
                while frame is not None:
                    yield np.frombuffer(frame, np.uint8).reshape(shape)
                    frame = child.read(int(np.prod(shape)))
                return
    raise RenderError(
        f"nothing on this machine can render ({'; '.join(complaints)}): install EGL or OSMesa "
        "(libegl1 or libosmesa6 on Debian), or draw the angles with -o FILE.png"
    )


class _Child:
    """The rendering process, ended when done with; its complaints are kept out of the user's sight."""

    def __init__(self, job: Path, backend: str) -> None:
        self._complaints = (job.parent / f"{backend}.txt").open("w+", encoding="utf-8", errors="replace")
        self._process = subprocess.Popen(
            [sys.executable, "-m", "metaid.show.rendering", str(job)],
            stdout=subprocess.PIPE,
            stderr=self._complaints,
            env={**os.environ, "MUJOCO_GL": backend, "PYOPENGL_PLATFORM": backend},
        )

    def read(self, count: int) -> bytes | None:
        """The next `count` bytes, or None when there are no more."""
        assert self._process.stdout is not None
        data = self._process.stdout.read(count)
        return data if len(data) == count else None

    def complaint(self) -> str:
        """Its last words."""
        self._process.wait()
        self._complaints.seek(0)
        lines = self._complaints.read().split("\n")
        return next((line.strip()[:160] for line in reversed(lines) if line.strip()), "ended without a word")

    def __enter__(self) -> _Child:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.communicate()
        self._complaints.close()


def _write_mp4(frames: Iterator[Frame], path: Path, rate: int) -> None:
    first = next(frames)
    # yuv420p plays in browsers, slides and phones.
    writer = imageio_ffmpeg.write_frames(
        str(path),
        (first.shape[1], first.shape[0]),
        fps=rate,
        codec="libx264",
        pix_fmt_out="yuv420p",
        macro_block_size=2,
    )
    writer.send(None)
    try:
        for frame in (first, *frames):
            writer.send(np.ascontiguousarray(frame))
    finally:
        writer.close()


def _write_gif(frames: Iterator[Frame], path: Path, rate: int) -> None:
    first, *others = (Image.fromarray(frame).quantize(32, dither=Image.Dither.NONE) for frame in frames)
    first.save(path, save_all=True, append_images=others, duration=1000 // rate, loop=0, optimize=True)
