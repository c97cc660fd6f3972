"""The child process that renders: `python -m metaid.show.rendering JOB.npz` writes raw RGB frames to its stdout.

It runs apart because MuJoCo chooses OpenGL by MUJOCO_GL when it is first imported, and because a broken driver ends
the process that calls it. Each frame is its panels side by side (size x npanel size x 3, uint8).
"""

from __future__ import annotations

import sys
from dataclasses import fields
from pathlib import Path

import mujoco
import numpy as np

from metaid.models import Array, Chain
from metaid.show.scene import front_camera, scene


def write_job(path: Path, chain: Chain, angles: Array, size: int) -> None:
    """Saves what to render.

    Args:
        path: of the file.
        chain: that is drawn.
        angles: of its joints (npanel x nframe x njoint), in rad.
        size: of a panel, in pixels.
    """
    np.savez(path, angles=angles, size=size, **{part.name: getattr(chain, part.name) for part in fields(chain)})


def render_job(path: Path) -> None:
    """Renders a saved job to standard output."""
    job = np.load(path, allow_pickle=False)
    chain = Chain(**{part.name: job[part.name] for part in fields(Chain)})
    model = scene(chain, gravity=9.81, timestep=0.001)  # nothing moves here: poses are set
    data, camera, size = mujoco.MjData(model), front_camera(chain, job["angles"]), int(job["size"])
    with mujoco.Renderer(model, size, size) as renderer:
        for poses in job["angles"].swapaxes(0, 1):
            panels = []
            for pose in poses:
                data.qpos[:] = pose
                mujoco.mj_forward(model, data)
                renderer.update_scene(data, camera)
                renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = 0  # takes seven times as long without a GPU
                panels.append(renderer.render())
            sys.stdout.buffer.write(np.hstack(panels).tobytes())


if __name__ == "__main__":
    render_job(Path(sys.argv[1]))
