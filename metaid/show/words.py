"""What the report says of a plant, of an episode, and of what is left open, where chains and arms differ."""

from __future__ import annotations

import re

import numpy as np
import tomli_w

from metaid.episode import Episode, Spatial
from metaid.models.tree import Tree
from metaid.plant import PlantSettings
from metaid.results import Findings
from metaid.study import DrawnNominalSettings, NominalSettings, StudySpec


def plural(count: int, noun: str) -> str:
    """`1 link`, `2 links`, `2 pushes`."""
    ending = "es" if noun.endswith("sh") else "s"
    return f"{count:,} {noun}{ending if count != 1 else ''}"


def nominal_words(nominal: str | NominalSettings | DrawnNominalSettings) -> str:
    """Where the nominal model of a study is from."""
    if isinstance(nominal, str):
        return nominal
    if isinstance(nominal, NominalSettings):
        return "the links in the study file"
    return f"drawn about {nominal.plant} with seed {nominal.seed}"


def plant_words(spec: StudySpec) -> str:
    """What the plant of a study is."""
    size = plural(len(spec.joints), "joint" if spec.is_arm else "link")
    pull = "" if spec.is_arm else f", gravity {spec.gravity} m/s²"
    faults = "".join(f"; {name} {value}" for name, value in spec.faults.named.items())
    return f"{spec.plant_name}: {size}{pull}, timestep {spec.timestep} s{faults}"


def episode_words(episode: Episode, timestep: float) -> str:
    """What is done to the plant with each candidate, torques being `timestep` (s) apart."""
    rule = episode.fall_rule
    lasting = f"{episode.steps:,} steps ({episode.steps * timestep:.3g} s)"
    if not isinstance(episode.kind, Spatial):
        return (
            f"{plural(len(episode.pushes), 'push')}, {lasting} after each; a link has fallen past "
            f"{np.degrees(rule.limit):.3g}° if it is {rule.margin:.3g} times faster than any was after the push"
        )
    springs = int(np.count_nonzero(episode.springs))
    coasts = episode.npush - springs
    return (
        f"{plural(coasts, 'push')} that coast{'s' * (coasts == 1)} and {springs} that swing{'s' * (springs == 1)} as "
        f"on springs, {lasting} each; a push has fallen in which a joint leaves its range, or is {rule.runaway:.3g} "
        "times faster than any was at a start"
    )


def joint_rows(found: Findings) -> list[dict[str, str]]:
    """The joints of the nominal model, where there is anything to say of them: of an arm."""
    if not found.spec.is_arm:
        return []
    nominal: Tree = found.problem.nominal

    def end(value: float, is_slide: bool) -> str:
        if not np.isfinite(value):
            return "none"
        return f"{value:g} m" if is_slide else f"{np.degrees(value):.0f}°"

    return [
        {"name": name, "kind": "slide" if slides else "hinge", "low": end(low, slides), "high": end(high, slides)}
        for name, slides, low, high in zip(
            nominal.names, nominal.slides.tolist(), nominal.low.tolist(), nominal.high.tolist(), strict=True
        )
    ]


def left_open(found: Findings) -> str:
    """What does not follow from what was `found`, in a sentence or two."""
    if found.spec.is_arm:
        return (
            "Base parameters are all that the torque depends on: single masses, centres of mass and moments of inertia "
            "do not follow from them."
        )
    lumps, said = found.problem.names, []
    if found.verdict.source != "estimate":
        said.append("Inertia lumps act in no term that is compensated.")
    if not any(name.startswith(("damping", "coulomb")) for name in lumps):
        said.append("Friction is not searched.")
    said.append("Lumps are what the dynamics need: single masses and lengths do not follow from them.")
    return " ".join(said)


def plant_caption(found: Findings) -> str:
    """What the picture of a plant shows."""
    if found.spec.is_arm:
        return (
            "Its joints, the arrows by the right-hand rule, and the last centre of mass, where the first push begins."
        )
    if shows_plant(found):
        return "The plant as it is simulated, bent a little at every joint. The search never sees these numbers."
    what = "A plant whose truth is not told" if found.problem.spec.is_simulated else "A rig"
    return f"{what}, drawn by the nominal model, bent a little at every joint."


def shows_plant(found: Findings) -> bool:
    """Whether the plant's own parameters may be shown: not of a rig, nor where its file has `truth_known = false`; of
    an arm the study has those of its joints and links alone, and the nominal ones are shown.
    """
    plant = found.spec.plant
    return isinstance(plant, PlantSettings) and plant.truth_known


def study_files(found: Findings) -> dict[str, str]:
    """Files, by name, that make this very study again, trial for trial, the study file last. Where the plant is not to
    be shown, the plant file is the reader's own.
    """
    spec, stem = found.spec, re.sub(r"[^\w-]+", "-", found.name)
    study = spec.study.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
    if spec.is_arm:
        return {f"{stem}.toml": tomli_w.dumps(study)}
    links = [link.model_dump(mode="json", exclude_none=True) for link in spec.links]
    study |= {"plant": f"{stem}-plant.toml", "nominal": {"links": links}}
    if spec.is_simulated and not shows_plant(found):
        study["plant"] = f"{spec.plant_name}.toml"
        return {f"{stem}.toml": tomli_w.dumps(study)}
    plant = spec.plant.model_dump(mode="json", exclude_none=True)
    return {f"{stem}-plant.toml": tomli_w.dumps(plant), f"{stem}.toml": tomli_w.dumps(study)}
