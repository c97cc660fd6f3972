"""The identified model of a study, and the files that it is written to.

What a file says of itself is at its top: of which study it is, what that found, and in which units.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from metaid.errors import StudyError, printable
from metaid.exporting.dynamics import Dynamics
from metaid.exporting.laws import Law, c_name
from metaid.exporting.xml_files import mjcf, not_in_urdf, urdf, without_springs
from metaid.frames import json_rows
from metaid.models import Array
from metaid.models.tree import Tree
from metaid.plant import LinkSettings

_BODIES = (".toml", ".xml", ".urdf")
_COLUMNS = ["name", "unit", "nominal", "factor", "identified", "sd", "low", "high", "determined"]


DID = {"found": "identified", "approximate": "identified approximately"}  # with the model, by the verdict


@dataclass(frozen=True)
class IdentifiedModel:
    """What a study, or a rig's log, identified, to be used elsewhere.

    Attributes:
        name: of the study, or of a rig's log.
        about: what is known of it: `plant`, `verdict`, `reasons`, `source`, `misfit`, `written` (the date), `metaid`
            (its version), and of a study `sampler`, `seed` and `trials`.
        lumps: one row a lump, or a base parameter of an arm, as `metaid.lumps` has them, with its `value` in the law:
            as it was identified, whether it is determined or not.
        covariance: of the lumps that an estimate knows, by name, in their units; None where it is not known.
        dynamics: how it moves.
        gravity: in m/s²; of an arm in the frame of its base (3).
        timestep: of the plant, in s.
    """

    name: str
    about: dict[str, Any]
    lumps: pd.DataFrame
    covariance: pd.DataFrame | None
    dynamics: Dynamics
    gravity: float | tuple[float, ...]
    timestep: float

    def __repr__(self) -> str:
        return f"<IdentifiedModel {self.name}: njoint={self.njoint}, {self.about['verdict']}>"

    def torque(self, q: ArrayLike, v: ArrayLike) -> Array:
        """The joint torque (... x njoint) of the compensation law, friction included, in N m (of a slide in N).

        Of a chain joint angles are relative to the link before, 0 upright. One state, or many at once: what has fewer
        dimensions holds for all.

        Args:
            q: joint angles (... x njoint), in rad (of a slide in m).
            v: joint speeds (... x njoint), in rad/s (of a slide in m/s).

        Raises:
            StudyError: there are not as many numbers as joints.
        """
        return self.dynamics.law.torque(*self._states(q=q, v=v))

    def inverse_dynamics(self, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
        """The joint torque (... x njoint) that gives the joints accelerations `a` (... x njoint), in rad/s² (m/s²), in
        N m (of a slide in N). Of rows, in the order of time, dry friction follows the motion.  Raises StudyError where
        the inertia lumps are not known.
        """
        return self._with_inertia.inverse_dynamics(*self._states(q=q, v=v, a=a))

    def mass_matrix(self, q: ArrayLike) -> Array:
        """The mass matrix (... x njoint x njoint) in joint coordinates `q` (... x njoint), in kg m² (kg m and kg where
        joints are slides).  Raises StudyError where the inertia lumps are not known.
        """
        return self._with_inertia.mass_matrix(*self._states(q=q))

    @property
    def _with_inertia(self) -> Law:
        if not self.dynamics.law.has_inertia:
            raise StudyError(
                f"study '{self.name}' has no inertia lumps, so no mass matrix (allowed: a study with an estimate)"
            )
        return self.dynamics.law

    def _states(self, **given: ArrayLike) -> tuple[Array, ...]:
        """All that is `given` (... x njoint), of one shape."""
        numbers, njoint = {name: np.asarray(each, dtype=np.float64) for name, each in given.items()}, self.njoint
        for name, each in numbers.items():
            if each.shape[-1:] != (njoint,):
                raise StudyError(f"{name} has the shape {each.shape} (allowed: {njoint} numbers, one a joint)")
        try:
            return np.broadcast_arrays(*numbers.values())
        except ValueError:
            shapes = ", ".join(f"{name} {each.shape}" for name, each in numbers.items())
            raise StudyError(f"shapes that do not go together: {shapes} (allowed: as many states of each)") from None

    @property
    def njoint(self) -> int:
        """How many joints it has."""
        return self.dynamics.law.njoint

    @property
    def origin(self) -> str:
        """What it was identified from, for a message."""
        return f"study '{self.name}'" if "sampler" in self.about else f"log {self.name}"

    @property
    def nominal(self) -> tuple[LinkSettings, ...] | Tree:
        """The nominal model of a study that starts from this one: the links of a plant file, or an arm.  Raises
        StudyError where no possible bodies have the lumps.
        """
        return tuple(LinkSettings(**link) for link in self.links) if self.dynamics.is_chain else self.tree

    @property
    def links(self) -> list[dict[str, float]]:
        """The links of a chain, as a plant file has them.  Raises StudyError where there are none."""
        _ = self.tree
        chain = self.dynamics.chain
        if chain is None:
            raise StudyError(
                f"{self.origin}: no chain with centres of mass on its links has the lumps that were found "
                f"(allowed: {', '.join(suffix for suffix in SUFFIXES if suffix != '.toml')})"
            )
        columns = {"length": chain.length, "mass": chain.mass, "com": chain.com, "inertia": chain.inertia}
        friction = {"damping": chain.damping, "frictionloss": chain.coulomb}
        columns |= {key: values for key, values in friction.items() if values.any()}
        return json_rows(pd.DataFrame(columns))

    def notes(self, suffix: str) -> list[str]:
        """What to know of a file with that `suffix`, in sentences without a full stop."""
        said = list(self.about["reasons"])
        if self.about["verdict"] not in DID:
            said.append(f"nothing is identified: these are the values of the {self.about['source']}, and may be wrong")
        return said + self.lacks(suffix)

    def lacks(self, suffix: str) -> list[str]:
        """What a file with that `suffix` cannot hold, in sentences without a full stop."""
        said = [self.dynamics.besides] if self.dynamics.besides else []
        said += self.dynamics.notes if suffix in _BODIES else ()
        tree = self.dynamics.tree
        if tree is None:
            return said
        if suffix == ".toml" and tree.rotor.any():
            said.append("rotors are not in a plant file")
        if suffix == ".urdf":
            said += not_in_urdf(tree, self.dynamics.friction)
        return said + without_springs(tree, self.dynamics.friction if suffix in (".urdf", ".toml") else None)

    def write(self, path: str | Path) -> None:
        """Writes a file: its ending says which of SUFFIXES.  Raises StudyError where there is no such file of it."""
        path = Path(path)
        path.write_text(self.text(path.suffix), encoding="utf-8")

    def text(self, suffix: str) -> str:
        """What a file with that `suffix` says.  Raises StudyError where there is no such file of it."""
        if suffix not in SUFFIXES:
            raise StudyError(f"no model is written as '{suffix}' (allowed: {', '.join(SUFFIXES)})")
        return SUFFIXES[suffix](self)

    @property
    def tree(self) -> Tree:
        """The bodies.  Raises StudyError where there are none."""
        if self.dynamics.tree is None:
            what = "lumps" if self.dynamics.is_chain else "base parameters"
            raise StudyError(
                f"{self.origin}: no possible bodies have the {what} that were found "
                f"(allowed: {', '.join(suffix for suffix in SUFFIXES if suffix not in _BODIES)})"
            )
        return self.dynamics.tree

    def heading(self, suffix: str) -> list[str]:
        """The lines at the top of a file with that `suffix`."""
        about, misfit = self.about, self.about["misfit"]
        did = DID.get(about["verdict"], "did not identify, but came to,")
        what = "lumps" if self.dynamics.is_chain else "base parameters"
        seeded = f", sampler {about['sampler']}, seed {about['seed']}" if "sampler" in about else ""
        lines = [
            f"The model that metaid {about['metaid']} {did} in the {self.origin}.",
            f"Written {about['written']}. Plant {about['plant']}{seeded}.",
            f"Verdict: {about['verdict']}, by the {about['source']}" + (f"; misfit {misfit:.3g}." if misfit else "."),
            "Units: m, kg, s, rad, N m and products of these.",
        ]
        if suffix in _BODIES:
            lines += [
                "The masses, centres of mass and moments of inertia here are not identified: combinations of them are,",
                f"the {what}. Of all possible bodies with these {what} they are closest to the nominal ones.",
            ]
        return [printable(line) for line in (*lines, *(f"{note}." for note in self.notes(suffix)))]


def _mjcf(model: IdentifiedModel) -> str:
    heading, friction = model.heading(".xml"), model.dynamics.friction
    return mjcf(model.tree, printable(model.name), model.timestep, heading, friction)


def _urdf(model: IdentifiedModel) -> str:
    return urdf(model.tree, printable(model.name), model.heading(".urdf"))


def _toml(model: IdentifiedModel) -> str:
    if not model.dynamics.is_chain:
        raise StudyError(
            f"{model.origin} is of an arm, whose plant file names an MJCF or a URDF "
            f"(allowed: {', '.join(suffix for suffix in SUFFIXES if suffix != '.toml')})"
        )
    import tomli_w

    links = model.links
    common = {"gravity": model.gravity, "timestep": model.timestep}
    what = "study" if "sampler" in model.about else "log"
    description = f"The model of the {what} {printable(model.name)}."
    return _comment(model.heading(".toml")) + tomli_w.dumps({"description": description, **common, "links": links})


def _python(model: IdentifiedModel) -> str:
    return f"{_comment(model.heading('.py'))}\n{model.dynamics.law.python()}"


def _c(model: IdentifiedModel) -> str:
    lines = "\n".join(f"   {line}" for line in model.heading(".h")).replace("*/", "* /").replace("/*", "/ *")
    return f"/*\n{lines}\n*/\n{model.dynamics.law.c(c_name(model.name))}"


def _json(model: IdentifiedModel) -> str:
    further = [name for name in ("sd_systematic", "expression") if name in model.lumps]
    rows = model.lumps[[*_COLUMNS, "value", *further]]
    covariance = model.covariance
    shown = {
        "name": model.name,
        **model.about,
        "units": "SI",
        "gravity": model.gravity,
        "timestep": model.timestep,
        "lumps": json_rows(rows),
        "covariance": None
        if covariance is None
        else {"names": covariance.columns.tolist(), "values": covariance.to_numpy().tolist()},
        "notes": model.notes(".json"),
    }
    return json.dumps(shown, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _comment(lines: list[str]) -> str:
    return "".join(f"# {line}\n" for line in lines)


SUFFIXES: dict[str, Callable[[IdentifiedModel], str]] = {
    ".toml": _toml,
    ".xml": _mjcf,
    ".urdf": _urdf,
    ".py": _python,
    ".h": _c,
    ".json": _json,
}
