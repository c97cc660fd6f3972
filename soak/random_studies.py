"""Studies at random, each by its number, with the files that a user would have: a plant, a nominal model, a study.

| | drawn from |
| --- | --- |
| robot | a planar chain of 1 to 4 links (`benchmarks.chains`), or an arm of 2 to 4 hinges in space |
| plant | of two cases one is simulated by metaid, the other is a bench that shares no code with it (`soak.bench`) |
| sampler, measure | of a simulated chain all of them; else `output-error` |
| trials | of a simulated chain 3 to 200, else 2 to 5 |
| bounds | of a simulated chain the default, or so narrow that they may exclude the truth |
| estimate | made, or of one in five simulated chains not; one in five takes up faults by itself, and every bench |
| sensors | ideal, or noise and pushes that differ; of a bench encoder steps |
| hidden | in one of three cases something that the model does not know, wrong geometry and springs among it |

Well posed is a study that makes an estimate, of a plant with nothing hidden, with enough trials of pushes whose measure
sees every lump: six of a simulated chain, four of a bench, two of a simulated arm.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from numpy.random import Generator

from benchmarks.chains import random_chain
from metaid.search import SAMPLERS
from soak.drawn_arms import DrawnArm, draw_arm

SEED = 11
NOISE: dict[str, Any] = {"angle_noise": 1e-3, "speed_sensor": False, "push_noise": 0.02}
ENCODER_STEP = 0.38e-3  # rad, of a bench
TIMESTEPS = (0.001, 0.002)  # s, of a bench
SHARE_HIDDEN = 0.35
CHAIN_HIDES: tuple[dict[str, Any], ...] = (
    {"links": {"damping": 0.05}},
    {"links": {"frictionloss": 0.05}},
    {"links": {"stiffness": 0.5}},
    {"faults": {"tilt": 0.03}},
    {"faults": {"torque_limit": 3.0}},
    {"faults": {"delay": 4}},
)
ARM_HIDES: tuple[dict[str, Any], ...] = (
    {"stiffness": 2.0},
    {"frames": 0.005},
    {"faults": {"tilt": 0.02}},
    {"faults": {"delay": 2}},
    {"faults": {"encoder_offset": 0.01}},
)
BENCH_HIDES: tuple[dict[str, Any], ...] = (
    {"viscous": (0.02, 0.01)},
    {"dry": (0.05, 0.04)},
    {"gains": (0.05, -0.05)},
    {"delay": 0.003, "delay_jitter": 0.1},
    {"torque_lag": 0.003},
    {"rotors": (0.0057, 0.0057)},
    {"cogging": (0.01, 0.01)},
    {"cable": (0.05, 0.05)},
    {"tilt": 0.01},
    {"geometry": 0.02},
)


@dataclass(frozen=True)
class Case:
    """A study by its files.

    Attributes:
        name: of the study.
        files: their texts, by their names; the study's is NAME.toml.
        about: it in words.
        well_posed: whether it is to be found.
        bench: what the bench has, on which it is tried; None where the plant is simulated.
        links: of the true chain, as a plant file has them; empty where it is an arm.
        arm: the true arm.
        timestep: of the bench, in s.
    """

    name: str
    files: Mapping[str, str]
    about: str
    well_posed: bool
    bench: Mapping[str, Any] | None = None
    links: tuple[dict[str, float], ...] = ()
    arm: DrawnArm | None = None
    timestep: float = 0.002


def draw(number: int) -> Case:
    """The case of that number; it may contradict itself."""
    return DRAWN[number % len(DRAWN)](number)


def write(case: Case, folder: Path, address: str | None = None) -> Path:
    """Writes the files of a case into a `folder`, with the `address` of its bench.

    Returns:
        The study's.
    """
    for name, text in case.files.items():
        (folder / name).write_text(text.replace("ADDRESS", address or ""))
    return folder / f"{case.name}.toml"


def _simulated_chain(number: int) -> Case:
    random = np.random.default_rng([SEED, number])
    nlink = int(random.integers(1, 5))
    true, nominal = random_chain(nlink, int(random.integers(1000, 1_000_000)))
    noisy, is_hidden = bool(random.random() < 0.3), random.random() < SHARE_HIDDEN
    hidden = CHAIN_HIDES[random.integers(len(CHAIN_HIDES))] if is_hidden else {}
    faults = (NOISE if noisy else {}) | hidden.get("faults", {})
    links = [_stated(link) | hidden.get("links", {}) for link in true]
    measure = "smoothed" if noisy else str(random.choice(["spectral", "spectral", "crossing", "count"]))
    sampler = str(random.choice(sorted(SAMPLERS)))
    trials = int(random.integers(3, 200 if nlink < 3 else 60))
    estimated = bool(random.random() < 0.8) or sampler == "output-error"
    bounds: dict[str, Any] = {}
    if random.random() < 0.3:
        bounds = {"low": float(random.uniform(0.6, 0.95)), "high": float(random.uniform(1.05, 1.5))}
    # Drawn last, so that all else of a case is what it was before this was drawn.
    takes_up = estimated and bool(random.random() < 0.2)
    study = {
        "plant": "plant.toml",
        "nominal": "nominal.toml",
        "sampler": sampler,
        "trials": trials,
        "seed": number,
        "workers": 1,
        "search": bounds,
        "episode": {"measure": measure},
        "estimate": {"enabled": estimated} | ({"faults": "proposed"} if takes_up else {}),
    }
    words = [f"{nlink} links", sampler, measure, f"{trials} trials", "noisy" if noisy else "ideal"]
    words += [f"hidden {hidden}"] if hidden else []
    words += ([] if estimated else ["no estimate"]) + (["faults taken up"] if takes_up else [])
    words += [f"bounds {bounds}"] if bounds else []
    files = {
        "plant.toml": {"links": links, "faults": faults},
        "nominal.toml": {"links": [_stated(link) for link in nominal]},
        f"case-{number}.toml": study,
    }
    well_posed = not hidden and estimated and trials >= 6 and measure in ("spectral", "smoothed")
    return Case(f"case-{number}", _texts(files), ", ".join(words), well_posed)


def _simulated_arm(number: int) -> Case:
    random = np.random.default_rng([SEED, number])
    arm, noisy, hidden = draw_arm(random), bool(random.random() < 0.5), _hidden(random, ARM_HIDES)
    trials = int(random.integers(2, 4))
    faults = ({"angle_noise": 1e-4, "speed_sensor": False} if noisy else {}) | hidden.get("faults", {})
    plant: dict[str, Any] = {"mjcf": "arm.xml", "faults": faults}
    if "stiffness" in hidden:
        plant["stiffness"] = dict.fromkeys(arm.names, hidden["stiffness"])
    takes_up = bool(random.random() < 0.2)
    study = _study(number, trials) | ({"estimate": {"faults": "proposed"}} if takes_up else {})
    files = _of_arm(arm, random, study, hidden) | _texts({"plant.toml": plant})
    words = [f"an arm of {len(arm.names)} joints", f"{trials} trials", "noisy" if noisy else "ideal"]
    words += ([f"hidden {hidden}"] if hidden else []) + (["faults taken up"] if takes_up else [])
    return Case(f"case-{number}", files, ", ".join(words), not hidden, arm=arm)


def _chain_on_bench(number: int) -> Case:
    random = np.random.default_rng([SEED, number])
    nlink = int(random.integers(1, 4))
    true, nominal = random_chain(nlink, int(random.integers(1000, 1_000_000)))
    links, believed = tuple(_stated(link) for link in true), [_stated(link) for link in nominal]

    def files(study: dict[str, Any], hidden: Mapping[str, Any]) -> dict[str, str]:
        if "geometry" not in hidden:
            whole = study | {"nominal": {"links": believed}}
        else:
            share = hidden["geometry"] * float(random.choice([-1.0, 1.0]))
            nominal = {"links": [_longer(link, share) for link in believed]}
            whole = study | {"nominal": nominal, "estimate": {"lengths": "exact"}}
        return _texts({f"case-{number}.toml": whole, "bench.toml": {"links": list(links)}})

    return _on_bench(random, number, nlink, f"{nlink} links", files, links=links)


def _arm_on_bench(number: int) -> Case:
    random = np.random.default_rng([SEED, number])
    arm = draw_arm(random)

    def files(study: dict[str, Any], hidden: Mapping[str, Any]) -> dict[str, str]:
        return _of_arm(arm, random, study, {"frames": 0.005} if "geometry" in hidden else {})

    n = len(arm.names)
    return _on_bench(random, number, n, f"an arm of {n} joints", files, arm=arm)


def _on_bench(
    random: Generator,
    number: int,
    joints: int,
    what: str,
    files: Callable[[dict[str, Any], Mapping[str, Any]], dict[str, str]],
    **true: Any,
) -> Case:
    """A case on a bench.

    Args:
        random: what else is drawn by.
        number: of the case.
        joints: of the bench.
        what: its robot is, in words.
        files: all but the plant's, of what the study says beside its nominal model, and of what is hidden.
        true: the robot, as a `Case` has it.
    """
    hidden, timestep = _hidden(random, BENCH_HIDES), float(random.choice(TIMESTEPS))
    study = _study(number, int(random.integers(3, 6)))
    rig = {"socket": "ADDRESS", "joints": joints, "timestep": timestep, "step_timeout": 60.0}
    has = {key: value[:joints] if isinstance(value, tuple) else value for key, value in hidden.items()}
    has.pop("geometry", None)
    words = [f"a bench of {what}", f"{1 / timestep:.0f} Hz", f"{study['trials']} trials"]
    return Case(
        name=f"case-{number}",
        files=files(study, hidden) | _texts({"plant.toml": rig}),
        about=", ".join(words + ([f"hidden {hidden}"] if hidden else [])),
        well_posed=not hidden and study["trials"] >= 4,
        bench={"encoder_step": ENCODER_STEP, "seed": float(number)} | has,
        timestep=timestep,
        **true,
    )


DRAWN: tuple[Callable[[int], Case], ...] = (_simulated_chain, _chain_on_bench, _simulated_arm, _arm_on_bench)


def _hidden(random: Generator, kinds: tuple[dict[str, Any], ...]) -> dict[str, Any]:
    kind = kinds[random.integers(len(kinds))]
    return kind if random.random() < SHARE_HIDDEN else {}


def _study(number: int, trials: int) -> dict[str, Any]:
    return {"plant": "plant.toml", "trials": trials, "seed": number}


def _of_arm(arm: DrawnArm, random: Generator, study: dict[str, Any], wrong: Mapping[str, Any]) -> dict[str, str]:
    """The files of a `study` of an arm but for its plant's; of `wrong` "frames" is by how much they are off, in m."""
    believed = arm.displaced(random, wrong["frames"]) if "frames" in wrong else arm.mjcf
    whole = study | {"nominal": {"plant": "nominal.toml", "seed": study["seed"]}}
    texts = _texts({"nominal.toml": {"mjcf": "believed.xml"}, f"case-{study['seed']}.toml": whole})
    return texts | {"arm.xml": arm.mjcf, "believed.xml": believed}


def _stated(link: Any) -> dict[str, float]:
    return {key: float(getattr(link, key)) for key in ("length", "mass", "com", "inertia")}


def _longer(link: dict[str, float], share: float) -> dict[str, float]:
    return link | {
        "length": link["length"] * (1.0 + share),
        "com": min(link["com"], link["length"] * (1.0 - abs(share))),
    }


def _texts(files: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    return {name: tomli_w.dumps(dict(tables)) for name, tables in files.items()}
