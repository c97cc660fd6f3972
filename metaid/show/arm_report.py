"""A study of an arm as one self-contained HTML page, of the parts that the page of a chain is made of."""

from __future__ import annotations

import shlex
from typing import Any

import numpy as np
import tomli_w

from metaid.models import Array
from metaid.results import Findings, shown_rows
from metaid.results.arms import ArmFindings
from metaid.show.figures import COLUMN, ArmGallery, rods_figure
from metaid.show.report import cost, estimate_texts, falls, file_stem, filled_in, inline_svg, page_figures, render

ERRORS = {"gravity": "gravity torque", "coriolis": "Coriolis torque", "mass_matrix": "mass matrix"}
UNITS = {"deg": "°", "mm": "mm"}
NOTHING = 1e-9  # of what a base parameter may have been wrong by: an error is no share of less


def render_any(found: Findings | ArmFindings) -> str:
    """The page of a study of a chain or of an arm."""
    return render_arm(found) if isinstance(found, ArmFindings) else render(found)


def render_arm(found: ArmFindings) -> str:
    """The page."""
    problem, gallery, spec = found.problem, ArmGallery(found), found.spec
    episode, tree = problem.episode, problem.nominal
    validation = None if found.validation is None else found.validation.summary()
    nominal, springs = spec.study.nominal, int(np.count_nonzero(episode.stiffness))
    return filled_in(
        "arm_report.html",
        found=found,
        summary=found.summary,
        study=spec.study,
        tree=tree,
        unit=problem.measure.unit,
        episode=episode,
        coasts=episode.npush - springs,
        springs=springs,
        timestep=problem.timestep,
        faults=[f"{name} {value}" for name, value in spec.faults.named.items()],
        nominal=nominal if isinstance(nominal, str) else f"drawn about {nominal.plant} with seed {nominal.seed}",
        plant_picture=inline_svg(rods_figure(problem.nominal_plant(), episode.starts[0], COLUMN), "plant-"),
        joints=[
            {
                "name": name,
                "kind": "slide" if tree.slides[i] else "hinge",
                "low": _end(tree.low[i], tree.slides[i]),
                "high": _end(tree.high[i], tree.slides[i]),
            }
            for i, name in enumerate(tree.names)
        ],
        errors=errors(found),
        validation=validation,
        units={} if found.validation is None else {UNITS[unit]: unit for unit in found.validation.kinds},
        lumps=base_rows(found),
        estimate=estimate_texts(found.summary),
        interval=_interval_name(found),
        unidentified=unidentified(found),
        figures=page_figures(gallery.pictures("page"), gallery.pictures("column")),
        left_out=gallery.left_out,
        falls=falls(found.trials, episode.total_steps),
        cost=cost(found.trials, problem.timestep, []),
        files=files(found),
        quoted_name=shlex.quote(found.name),
    )


def errors(found: ArmFindings) -> list[dict[str, Any]]:
    """How wrong the nominal and the identified arm are on states that no trial has seen, where the truth is known."""
    nominal, identified = found.nominal_error, found.summary["model_error"] or {}
    if nominal is None:
        return []
    return [{"name": ERRORS[key], "nominal": nominal[key], "identified": identified.get(key)} for key in ERRORS]


def base_rows(found: ArmFindings) -> list[dict[str, Any]]:
    """The base parameters as the summary has them, without an error of one that is next to nothing."""
    beforehand: Array = np.sqrt(np.diag(found.problem.prior.covariance))
    return [
        {**row, "error": None if row["true"] is None or abs(row["true"]) < NOTHING * scale else row["error"]}
        for row, scale in zip(shown_rows(found.summary), beforehand.tolist(), strict=True)
    ]


def unidentified(found: ArmFindings) -> list[dict[str, Any]]:
    """Base parameters that the study does not determine, each with the reason."""
    if not found.verdict.has_result:
        return [{"name": "all", "why": f"{found.verdict.word}: see the verdict"}]
    why = "these trials do not know it to a tenth of what it is, or of what it may have been wrong by beforehand"
    return [{"name": row["name"], "why": why} for row in found.summary["lumps"] if not row["determined"]]


def files(found: ArmFindings) -> dict[str, str]:
    """A study file, by its name, that makes this very study again, trial for trial, where its plant file is."""
    study = found.spec.study.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
    return {f"{file_stem(found.name)}.toml": tomli_w.dumps(study)}


def _interval_name(found: ArmFindings) -> str:
    """What `low` to `high` of the base parameters is."""
    if found.verdict.source == "best trial" or found.estimate is None:
        return "range of what cannot be told from the best trial"
    return found.estimate.interval_name


def _end(value: float, is_slide: bool) -> str:
    """An end of a joint's range."""
    if not np.isfinite(value):
        return "none"
    return f"{value:g} m" if is_slide else f"{np.degrees(value):.0f}°"
