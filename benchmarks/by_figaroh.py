"""figaroh's regressor pipeline beside plain least squares, on one chain: is it another method?

    python -m benchmarks.by_figaroh        # with figaroh and pinocchio installed (pip install figaroh)

Both get the same filtered motion and torques. figaroh makes pinocchio's regressor with ten parameters a link, leaves
out the columns that nothing shows, reduces the others to base parameters by QR decompositions, and solves by least
squares. Printed is the error of the torque of each model on held-out states, with each filter, in natural times wide.
"""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.metadata import version
from importlib.util import find_spec
from types import SimpleNamespace
from typing import Any

import numpy as np

from benchmarks.by_torque import inverse_dynamics_regressor
from benchmarks.chains import random_chain
from benchmarks.common import NEEDS_MORE, table
from benchmarks.rivals.conditions import CONDITIONS
from benchmarks.rivals.logs import record
from benchmarks.rivals.models import ChainModel
from benchmarks.rivals.regression import SPANS, motions, ordinary, rows_of, search_beforehand
from metaid.models import Array, Chain
from metaid.plant import chain_of

LINKS, SECONDS, HELD_OUT = 3, 15.0, 200


def pinocchio_chain(chain: Chain, gravity: float) -> Any:
    """The chain as figaroh takes it: a robot with a `model` and its `data`; `gravity` in m/s²."""
    pin = import_module("pinocchio")
    model, parent, height = pin.Model(), 0, 0.0
    model.gravity.linear = np.array([0.0, 0.0, -gravity])
    for i in range(chain.nlink):
        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, height]))
        parent = model.addJoint(parent, pin.JointModelRY(), place, f"joint_{i + 1}")
        inertia = pin.Inertia(chain.mass[i], np.array([0.0, 0.0, chain.com[i]]), chain.inertia[i] * np.eye(3))
        model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
        height = float(chain.length[i])
    return SimpleNamespace(model=model, data=model.createData())


def main() -> None:
    """Prints a row for each of the two."""
    if find_spec("figaroh") is None:
        print("figaroh is not installed (pip install figaroh)", file=sys.stderr)
        sys.exit(NEEDS_MORE)
    tools, qr = import_module("figaroh.tools.regressor"), import_module("figaroh.tools.qrdecomposition")
    true, nominal = random_chain(LINKS, 0)
    log = record(true, nominal, CONDITIONS["coarse"], SECONDS, 0)
    model = log.model
    assert isinstance(model, ChainModel)
    robot = pinocchio_chain(model.nominal, model.gravity)
    random = np.random.default_rng(0)
    held_out = random.uniform(-1.0, 1.0, (3, HELD_OUT, LINKS)) * np.array([1.5, 5.0, 20.0])[:, None, None]
    chain = chain_of(true)
    right = inverse_dynamics_regressor(held_out[0], held_out[1], held_out[2], model.gravity) @ np.append(
        chain.lumps.vector, chain.inertia_lumps
    )
    names = {f"parameter {i}": 0.0 for i in range(10 * LINKS)}

    def rows(angles: Array, speeds: Array, accelerations: Array) -> Array:
        whole = tools.build_regressor_basic(
            robot, angles, speeds, accelerations, {"is_joint_torques": True, "act_idxv": range(LINKS)}
        )
        return np.asarray(whole)

    found_plain, found_figaroh = [], []
    for motion in motions(log, log.seen.angles, log.seen.speeds, search_beforehand(log)):
        plain = ordinary(rows_of(log, motion))
        matrix = rows(motion.angles, motion.speeds, motion.accelerations)
        left_out, kept = tools.get_index_eliminate(matrix, names)
        reduced = tools.build_regressor_reduced(matrix, left_out)
        found = qr.QRDecomposer().decompose(reduced, kept, motion.torques.T.ravel())
        shown = tools.build_regressor_reduced(rows(*held_out), left_out)[:, list(found.base_indices)] @ found.phi_b
        ours = inverse_dynamics_regressor(held_out[0], held_out[1], held_out[2], model.gravity) @ plain
        found_plain.append(_share(ours, right))
        found_figaroh.append(_share(shown.reshape(LINKS, HELD_OUT).T, right))
        print(f"{found.rank} base parameters of figaroh, {len(plain)} of least squares", file=sys.stderr)
    columns = [f"{span:g}" for span in SPANS]
    named = {"least squares": found_plain, f"figaroh {version('figaroh')}": found_figaroh}
    print(
        table(
            [
                {
                    "filter, √(l/g)": name,
                    **{column: f"{100.0 * error:.2g} %" for column, error in zip(columns, errors, strict=True)},
                }
                for name, errors in named.items()
            ]
        )
    )


def _share(one: Array, other: Array) -> float:
    return float(np.sqrt(((one - other) ** 2).sum() / (other**2).sum()))


if __name__ == "__main__":
    main()
