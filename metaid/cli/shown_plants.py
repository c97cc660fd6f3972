"""What `metaid plant show` prints, by what a plant file says."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import singledispatch
from pathlib import Path
from typing import Any

import numpy as np

from metaid.cli.common import print_json, print_table, warn
from metaid.frames import number_text
from metaid.models import Array, lump_names, lump_unit
from metaid.models.tree import PARAMETERS, Spring, planar_chain
from metaid.plant import ArmPlant, ArmSettings, MujocoPlant, PlantSettings, SocketSettings


@singledispatch
def show(settings: Any, name: str, as_json: bool) -> None:
    """What is known of the plant of that `name`."""
    raise TypeError(settings)


@show.register
def _chain(settings: PlantSettings, name: str, as_json: bool) -> None:
    """Its links, and its true lumps where it knows them."""
    shown = MujocoPlant(name, settings)
    warn([shown.question])
    chain, own = shown.chain, shown.chain.lumps_of(shown.chain.kinds)
    columns = ("length", "mass", "com", "inertia", "damping", "coulomb", "stiffness")
    links = [
        dict(zip(columns, map(float, row), strict=True))
        for row in zip(*(getattr(chain, column) for column in columns), strict=True)
    ]
    lumps = _lump_rows(own.names, None if shown.true_lumps() is None else own.vector)
    if as_json:
        common = {key: getattr(shown.settings, key) for key in ("gravity", "timestep", "over_compensation")}
        faults = shown.settings.faults.model_dump(mode="json")
        print_json({"plant": shown.name, **common, "faults": faults, "links": links, "lumps": lumps})
        return
    heading = ["link", "length, m", "mass, kg", "com, m", "inertia, kg m²", "damping, N m s", "dry friction, N m"]
    heading.append("stiffness, N m/rad")
    dispensable = ["stiffness, N m/rad", "dry friction, N m", "damping, N m s"]
    fault = shown.settings.over_compensation
    rows = [[str(i + 1), *(number_text(link[column]) for column in columns)] for i, link in enumerate(links)]
    print_table(
        f"{shown.name}: {shown.settings.description}",
        heading,
        rows,
        f"gravity {shown.gravity} m/s², timestep {shown.timestep} s"
        + (f"; declared fault: the torque that it receives has gravity factors larger by {fault}" if fault else "")
        + "".join(f"; {name} {value}" for name, value in shown.settings.faults.named.items()),
        dispensable=dispensable,
    )
    _print_lumps("True lumps", lumps)


@show.register
def _rig(settings: SocketSettings, name: str, as_json: bool) -> None:
    """What is known of a plant behind a socket; it is not called for that."""
    names, known = lump_names(settings.joints), settings.model_dump(exclude={"description"})
    if as_json:
        print_json({"plant": name, **known, "links": [], "lumps": _lump_rows(names, None)})
        return
    rows = [[key, str(value)] for key, value in known.items()]
    note = f"This plant is a rig, so its {len(names)} true lumps are not known."
    print_table(f"{name}: {settings.description}", ["setting", "value"], rows, note, words=["value"])


@show.register
def _arm(settings: ArmSettings, name: str, as_json: bool) -> None:
    """Its joints with their axes and limits, and the parameters of its links."""
    arm = ArmPlant(name, settings)
    warn([arm.question])
    tree, lost = arm.tree, arm.arm.whole.lost_meshes
    _, axes = arm.arm.whole.joints_at(arm.home)
    joints = [
        {
            "name": name,
            "kind": "slide" if tree.slides[i] else "hinge",
            "axis": (axes[i].round(12) + 0.0).tolist(),
            **{key: _finite(getattr(tree, key)[i]) for key in ("low", "high")},
            "home": float(arm.home[i]),
            "torque_limit": _finite(tree.torque_limit[i]),
            "stiffness": float(arm.stiffness[i]),
            "slack": float(arm.slack[i]),
        }
        for i, name in enumerate(tree.names)
    ]
    chain = planar_chain(tree) if settings.truth_known else None
    own = None if chain is None else chain.lumps_of(chain.kinds)
    lumps = [] if own is None else _lump_rows(own.names, own.vector)
    warn(arm.repairs)
    if as_json:
        common: dict[str, Any] = {settings.kind: settings.file, "lost_meshes": lost, "gravity": tree.gravity.tolist()}
        common["repairs"] = arm.repairs
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
        + "".join(
            f"; a spring in {name}, {Spring(i, arm.stiffness[i], arm.slack[i]).text(bool(tree.slides[i]))}"
            for i, name in enumerate(tree.names)
            if arm.stiffness[i]
        )
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
        _print_lumps("True lumps of a planar chain", lumps)


def _lump_rows(names: Sequence[str], true: Array | None) -> list[dict[str, Any]]:
    """The lumps of those `names` as `plant show --json` has them; None where they are not known."""
    values = [None] * len(names) if true is None else true.tolist()
    return [{"name": name, "unit": lump_unit(name), "true": value} for name, value in zip(names, values, strict=True)]


def _print_lumps(title: str, lumps: Sequence[dict[str, Any]]) -> None:
    rows = [[lump["name"], number_text(lump["true"]), lump["unit"]] for lump in lumps]
    print_table(title, ["lump", "value", "unit"], rows, words=["unit"])


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _three(vector: np.ndarray[Any, np.dtype[np.float64]]) -> str:
    """Three numbers in one cell."""
    return " ".join(number_text(value, ".4g") for value in (vector.round(9) + 0.0).tolist())
