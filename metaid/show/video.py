"""Moving pictures, without a screen: panels side by side, each of the same plant under the law of a candidate.

Frames come from a child process (`metaid.show.rendering`), with EGL or else OSMesa unless MUJOCO_GL says which.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
from mujoco import MjModel
from numpy.typing import NDArray

from metaid.errors import RenderError, optional_packages
from metaid.models import Array
from metaid.show.rendering import Camera, write_job
from metaid.show.stages import Clip, Stage

with optional_packages("video"):
    import imageio_ffmpeg
    import OpenGL  # noqa: F401, the child process needs it
    from PIL import Image, ImageDraw, ImageFont

SUFFIXES = (".mp4", ".gif")
RATES = {".mp4": 25, ".gif": 10}  # frames per second
SIZES = {".mp4": 384, ".gif": 240}  # pixels, of each square panel
BACKENDS = ("egl", "osmesa")
CAPTION = 32  # pixels above the panels
Frame = NDArray[np.uint8]


def film(stage: Stage, candidates: Mapping[str, Any], path: Path) -> None:
    """Writes what a simulated plant does, in real time, as a file whose ending says the format. The `candidates` are
    the laws that it is compensated with, one a panel, by the panel's caption.  Raises RenderError where nothing here
    can render.
    """
    rate, size = RATES[path.suffix], SIZES[path.suffix]
    motions = [stage.motion(law, caption, rate) for caption, law in candidates.items()]
    model, poses = stage.model, stage.poses(together(motions))
    heading = _heading([motion.caption for motion in motions], size)
    frames = (np.vstack([heading, frame]) for frame in _render(model, poses, stage.camera(poses), size))
    (_write_gif if path.suffix == ".gif" else _write_mp4)(frames, path, rate)


def together(motions: Sequence[Clip]) -> Array:
    """The joint angles of all panels (npanel x nframe x njoint): one that fell stands still while the others go on."""
    length = max(len(motion.angles) for motion in motions)
    return np.array([np.pad(motion.angles, ((0, length - len(motion.angles)), (0, 0)), "edge") for motion in motions])


def _heading(captions: list[str], size: int) -> Frame:
    image = Image.new("RGB", (size * len(captions), CAPTION), "white")
    pen, font = ImageDraw.Draw(image), ImageFont.load_default(size // 16)
    for i, caption in enumerate(captions):
        pen.text((size * (i + 0.5), CAPTION / 2), caption, fill="black", font=font, anchor="mm")
    return np.asarray(image)


def _render(model: MjModel, poses: Array, camera: Camera, size: int) -> Iterator[Frame]:
    """Frames of joint coordinates (npanel x nframe x nq) from the first OpenGL that works."""
    chosen = os.environ.get("MUJOCO_GL")
    complaints = []
    shape = (size, size * len(poses), 3)
    with tempfile.TemporaryDirectory() as folder:
        job = Path(folder) / "job.npz"
        write_job(job, model, poses, camera, size)
        for backend in [chosen] if chosen else BACKENDS:
            with closing(_Child(job, backend)) as child:
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

    def close(self) -> None:
        """Ends it."""
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
