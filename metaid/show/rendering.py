"""The child process that renders: `python -m metaid.show.rendering JOB.npz` writes raw RGB frames to its stdout.

It runs apart because MuJoCo chooses OpenGL by MUJOCO_GL when it is first imported, and because a broken driver ends
the process that calls it. Each frame is its panels side by side (size x npanel size x 3, uint8).
"""

from __future__ import annotations

import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from metaid.models import Array


@dataclass(frozen=True)
class Camera:
    """Where a picture is taken from: what it looks at (3) and from how far, in m, and from which side, in degrees."""

    lookat: tuple[float, ...]
    distance: float
    azimuth: float
    elevation: float


def write_job(path: Path, model: mujoco.MjModel, poses: Array, camera: Camera, size: int) -> None:
    """Saves what to render.

    Args:
        path: of the file; the model is saved beside it.
        model: that is drawn.
        poses: coordinates of its joints (npanel x nframe x nq), in rad or m.
        camera: for all panels.
        size: of a panel, in pixels.
    """
    mujoco.mj_saveModel(model, str(path.with_suffix(".mjb")), None)
    np.savez(path, poses=poses, size=size, **asdict(camera))


def render_job(path: Path) -> None:
    """Renders a saved job to standard output."""
    job = np.load(path, allow_pickle=False)
    model = mujoco.MjModel.from_binary_path(str(path.with_suffix(".mjb")))
    data, camera, size = mujoco.MjData(model), mujoco.MjvCamera(), int(job["size"])
    for name in Camera.__dataclass_fields__:
        setattr(camera, name, job[name])
    has_sky = (model.tex_type == mujoco.mjtTexture.mjTEXTURE_SKYBOX).any()
    with mujoco.Renderer(model, size, size) as renderer:

        def panel(pose: Array) -> NDArray[np.uint8]:
            data.qpos[:] = pose
            mujoco.mj_forward(model, data)
            renderer.update_scene(data, camera)
            renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = 0  # takes seven times as long without a GPU
            picture = renderer.render()
            return picture if has_sky else _on_white(renderer, picture)

        for poses in job["poses"].swapaxes(0, 1):
            sys.stdout.buffer.write(np.hstack([panel(pose) for pose in poses]).tobytes())


def _on_white(renderer: Any, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The `picture` with white where nothing is: without a sky that is black."""
    renderer.enable_segmentation_rendering()
    nothing = renderer.render()[..., 0] < 0
    renderer.disable_segmentation_rendering()
    return np.where(nothing[..., None], np.uint8(255), picture)


if __name__ == "__main__":
    render_job(Path(sys.argv[1]))
