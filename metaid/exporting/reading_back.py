"""The files of a model loaded again, as a stranger would, and the joint torques that they predict along a motion."""

from __future__ import annotations

import runpy
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from metaid.errors import usable_mujoco
from metaid.exporting.laws import c_name, filled_in
from metaid.models import Array
from metaid.plant import load_chain

COMPILERS = ("cc", "gcc", "clang")


@dataclass(frozen=True)
class FileTorques:
    """What a file predicts.

    Attributes:
        torques: of the joints (nrow x njoint), in N m (of slides in N); None where it predicts none.
        why_not: why it predicts none, in a sentence without a full stop; else empty.
    """

    torques: Array | None
    why_not: str = ""


def file_torques(
    path: str | Path, name: str, q: Array, v: Array, a: Array, joints: Sequence[str], gravity: Array | None = None
) -> FileTorques:
    """The joint torques that a written file predicts along a motion.

    An MJCF and a URDF are asked through MuJoCo's inverse dynamics (`qfrc_inverse`), a plant file through the chain that
    metaid makes of it, the law in Python by running it and in C by compiling it. MuJoCo's dry friction is a soft
    constraint, whose sign is that of q̈ + b q̇ and less than whole near 0; b = 2/(dmax timeconst) is 105 1/s unless the
    file says otherwise, as those of metaid do. Ranges of joints and contacts, which would push back what was measured a
    little beyond, are off.

    Args:
        path: of the file; its ending says what it is.
        name: of the model that was written, by which functions in C are called.
        q: coordinates of the joints (nrow x njoint), in rad (m); rows are in the order of time.
        v: their speeds (nrow x njoint), in rad/s (m/s).
        a: their accelerations (nrow x njoint), in rad/s² (m/s²).
        joints: the names of the joints (njoint), in the order of these columns.
        gravity: in the frame of the base (3), in m/s², for a URDF, which has none; None for MuJoCo's own.
    """
    path = Path(path)
    match path.suffix:
        case ".xml" | ".urdf":
            return FileTorques(_by_mujoco(_loaded(path, gravity), q, v, a, joints))
        case ".toml":
            return FileTorques(_by_mujoco(load_chain(path).model, q, v, a, None))
        case ".py":
            return _by_python(path, q, v, a)
        case ".h":
            return _by_c(path, c_name(name), q, v, a)
        case _:
            return FileTorques(None, f"a file that ends in '{path.suffix}' holds numbers, and nothing that moves")


def _loaded(path: Path, gravity: Array | None) -> Any:
    """The model (mujoco.MjModel) of an MJCF or a URDF; gravity is set of a URDF alone."""
    with usable_mujoco():
        import mujoco
    model = mujoco.MjModel.from_xml_path(str(path))
    if path.suffix == ".urdf" and gravity is not None:
        model.opt.gravity[:] = gravity
    return model


def _by_mujoco(model: Any, q: Array, v: Array, a: Array, joints: Sequence[str] | None) -> Array:
    """`qfrc_inverse` of each row; `joints` are named where they may have another order than the model's."""
    import mujoco

    off = mujoco.mjtDisableBit
    model.opt.disableflags |= int(off.mjDSBL_LIMIT | off.mjDSBL_CONTACT)
    data = mujoco.MjData(model)
    numbers = np.arange(model.njnt) if joints is None else np.array([model.joint(each).id for each in joints])
    positions, dofs = model.jnt_qposadr[numbers], model.jnt_dofadr[numbers]
    torques = np.empty(q.shape)
    for row, (angles, speeds, accelerations) in enumerate(zip(q, v, a, strict=True)):
        data.qpos[positions], data.qvel[dofs], data.qacc[dofs] = angles, speeds, accelerations
        mujoco.mj_inverse(model, data)
        torques[row] = data.qfrc_inverse[dofs]
    return torques


def _by_python(path: Path, q: Array, v: Array, a: Array) -> FileTorques:
    law = runpy.run_path(str(path)).get("inverse_dynamics")
    if law is None:
        return FileTorques(None, "its law has no inertia, so no inverse dynamics")
    return FileTorques(np.array(law(q.tolist(), v.tolist(), a.tolist()), dtype=np.float64).reshape(q.shape))


def _by_c(path: Path, name: str, q: Array, v: Array, a: Array) -> FileTorques:
    compiler = next((found for each in COMPILERS if (found := shutil.which(each))), None)
    if compiler is None:
        return FileTorques(None, f"there is no C compiler here (looked for {', '.join(COMPILERS)})")
    text = path.read_text(encoding="utf-8")
    if f"{name}_inverse_dynamics(" not in text:
        return FileTorques(None, "its law has no inertia, so no inverse dynamics")
    asking = filled_in("main.c", name=name, njoint=q.shape[1], slides=f"{name}_slide(" in text)
    with TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "law.h").write_text(text, encoding="utf-8")
        (place / "main.c").write_text(asking, encoding="utf-8")
        built = subprocess.run(
            [compiler, "-std=c99", "-O1", "main.c", "-o", "main", "-lm"], cwd=place, capture_output=True, text=True
        )
        if built.returncode:
            said = built.stderr.strip().splitlines() or ["it says nothing"]
            return FileTorques(None, f"the C compiler refuses it: {said[0]}")
        states = np.ascontiguousarray(np.stack([q, v, a], axis=1), dtype=np.float64)
        done = subprocess.run([place / "main"], input=states.tobytes(), capture_output=True, check=True)
    return FileTorques(np.frombuffer(done.stdout, dtype=np.float64).reshape(q.shape).copy())
