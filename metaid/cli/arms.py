"""What `metaid plant show` and `metaid episode` print of an arm."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from metaid.cli.common import (
    FIGURE_SUFFIXES,
    lump_rows,
    number_text,
    open_store,
    print_json,
    print_lumps,
    print_table,
    whole_file,
)
from metaid.models.tree import PARAMETERS, planar_chain
from metaid.plant.arms import ArmPlant

if TYPE_CHECKING:
    from metaid.compiled.arms import ArmPush


def show_arm(arm: ArmPlant, as_json: bool) -> None:
    """Its joints with their axes and limits, and the parameters of its links."""
    tree, settings, lost = arm.tree, arm.settings, arm.arm.whole.lost_meshes
    _, axes = arm.arm.whole.joints_at(arm.home)
    joints = [
        {
            "name": name,
            "kind": "slide" if tree.slides[i] else "hinge",
            "axis": (axes[i].round(12) + 0.0).tolist(),
            **{key: _finite(getattr(tree, key)[i]) for key in ("low", "high")},
            "home": float(arm.home[i]),
            "torque_limit": _finite(tree.torque_limit[i]),
        }
        for i, name in enumerate(tree.names)
    ]
    chain = planar_chain(tree) if settings.truth_known else None
    lumps = [] if chain is None else lump_rows(chain.lumps_of(chain.kinds))
    if as_json:
        common: dict[str, Any] = {settings.kind: settings.file, "lost_meshes": lost, "gravity": tree.gravity.tolist()}
        links = [dict(zip(PARAMETERS, row, strict=True)) for row in tree.parameters.tolist()]
        faults = settings.faults.model_dump(mode="json")
        print_json(
            {"plant": arm.name, **common, "timestep": arm.timestep, "faults": faults, "joints": joints, "links": links}
            | ({"lumps": lumps} if lumps else {})
        )
        return
    rows = [
        [
            str(joint["name"]),
            str(joint["kind"]),
            _three(axes[i]),
            *(number_text(joint[key]) for key in ("low", "high", "home", "torque_limit")),
        ]
        for i, joint in enumerate(joints)
    ]
    angle, torque = ("rad or m", "N m or N") if tree.slides.any() else ("rad", "N m")
    heading = ["joint", "kind", "axis at home", f"low, {angle}", "high", "home", f"torque limit, {torque}"]
    print_table(
        f"{arm.name}: {settings.description}",
        heading,
        rows,
        f"{settings.kind} {Path(settings.file).name}; gravity {_three(tree.gravity)} m/s², timestep {arm.timestep} s"
        + "".join(f"; {name} {value}" for name, value in settings.faults.named.items())
        + (f"; meshes that cannot be loaded, so that nothing keeps clear of them: {len(lost)}" if lost else ""),
        words=["kind"],
        dispensable=["home", "kind"],
    )
    heading = ["link of joint", "mass, kg", "centre of mass, m", "principal inertias, kg m²", "rotor, kg m²"]
    heading += ["damping, N m s", "dry friction, N m"]
    rows = [
        [
            name,
            number_text(tree.mass[i]),
            _three(tree.com[i]),
            _three(np.linalg.eigvalsh(tree.inertia[i])),
            *(number_text(values[i]) for values in (tree.rotor, tree.damping, tree.coulomb)),
        ]
        for i, name in enumerate(tree.names)
    ]
    note = "In the frame of the link, whose origin is on the axis of its joint."
    note += " Of a slide: kg, N s/m, N." if tree.slides.any() else ""
    print_table("Links", heading, rows, note, dispensable=[*heading[:3:-1], heading[3]])
    if lumps:
        print_lumps("True lumps of a planar chain", lumps)


def draw_push_to(push: ArmPush, output: Path) -> None:
    """Draws what each joint does after a push."""
    from metaid.show.figures import draw_push

    with whole_file(output, FIGURE_SUFFIXES) as partial:
        draw_push(push, partial)


def show_push(push: ArmPush, as_json: bool) -> None:
    """What each joint does after a push."""
    shown = push.summary()
    if as_json:
        print_json(shown)
        return
    what = (
        f"fell after {shown['fall_time_s']:.3g} s, at step {shown['fall_step']} of {shown['steps']}"
        if shown["fell"]
        else f"{shown['steps']} steps without a fall; kinetic {number_text(shown['kinetic_hz'], '.3g')} Hz"
    )
    keys = "from", "to", "start_speed", "end_speed"
    rows = [
        [joint["name"], joint["does"], *(number_text(joint[key], ".4g") for key in keys)] for joint in shown["joints"]
    ]
    unit = "rad or m" if push.slides.any() else "rad"
    heading = ["joint", "it", f"from, {unit}", "to", "speed at the start, 1/s", "at the end"]
    print_table(f"{push.plant}: {what}", heading, rows, words=["it"])


def film_study_of_arm(arm: ArmPlant, study_name: str | None, storage: str, video: Path) -> None:
    """Films an arm under the laws of a study: of the nominal arm, the identified one and the true one.

    Args:
        arm: that is filmed.
        study_name: of the study; an arm is not filmed without one.
        storage: of the DB.
        video: the file.
    """
    from metaid.results.arms import laws_of
    from metaid.show import SUFFIXES, ArmStage, film

    if study_name is None:
        raise click.UsageError(f"--video: plant {arm.name} is an arm (allowed of an arm: with --study NAME)")
    with open_store(storage) as store, whole_file(video, SUFFIXES, "--video") as partial:
        nominal, laws = laws_of(store, study_name, arm)
        film(ArmStage(arm, nominal), laws, partial)


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _three(vector: np.ndarray[Any, np.dtype[np.float64]]) -> str:
    """Three numbers in one cell."""
    return " ".join(number_text(value, ".4g") for value in (vector.round(9) + 0.0).tolist())
