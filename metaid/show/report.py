"""A study as one self-contained HTML page."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from metaid.results import MODEL_ERRORS, Findings, body_rows, describe_possible_bodies, estimate_texts, shown_rows
from metaid.show.figures import Gallery, sketch
from metaid.show.figures.style import WIDTHS
from metaid.show.pages import PageFigure, Watch, filled_in, page_figure, page_figures
from metaid.show.words import (
    episode_words,
    joint_rows,
    left_open,
    nominal_words,
    plant_caption,
    plant_words,
    plural,
    shows_plant,
    study_files,
)

UNITS = {"deg": "°", "mm": "mm"}
OF_SEARCH = {"convergence", "factors", "frequency", "boundary", "parallel", "correlation", "episode"}  # figures
WIDEST = 0.02  # of a lump's value: a wider range is reported


def render(found: Findings, watch: Watch = lambda what: None) -> str:
    """The page. `watch` is told which figure is drawn next.  Raises StorageError where there is nothing to show yet."""
    gallery = Gallery(found)
    return page(found, gallery, page_figures(gallery, watch))


def page(found: Findings, gallery: Gallery, drawn: Sequence[PageFigure]) -> str:
    """The page with those figures of the `gallery` that are `drawn`."""
    problem, spec = found.problem, found.spec
    bodies = shown_rows(found.summary | body_rows(found.snapshot), "bodies")
    return filled_in(
        "report.html",
        found=found,
        noun=found.sought.noun,
        summary=found.summary,
        lumps=shown_rows(found.summary),
        faults=shown_rows(found.summary, "faults"),
        study=spec.study,
        settings=settings(found),
        plant_picture=plant_picture(found),
        joints=joint_rows(found),
        errors=errors(found),
        validation=None if found.validation is None else found.validation.summary(),
        units={} if found.validation is None else {UNITS[unit]: unit for unit in found.validation.kinds},
        left_open=left_open(found),
        left_out=gallery.left_out,
        figures=[picture for picture in drawn if picture.name not in OF_SEARCH],
        search_figures=[picture for picture in drawn if picture.name in OF_SEARCH],
        falls=falls(found.trials, problem.episode.total_steps),
        cost=cost(found.trials, problem.timestep, reached(found)),
        unidentified=unidentified(found),
        estimate=estimate_texts(found.summary),
        expressions={
            row["name"]: row["expression"]
            for row in found.summary["lumps"]
            if row.get("expression", row["name"]) != row["name"]
        },
        bodies=bodies,
        describe_possible_bodies=describe_possible_bodies(bodies) if bodies else None,
        files=study_files(found),
        quoted_name=shlex.quote(found.name),
    )


def settings(found: Findings) -> dict[str, str]:
    """What was searched, by what each text is about."""
    study, shown, unit = found.spec.study, found.summary, found.problem.measure.unit
    coordinates = study.search.model_dump().get("coordinates")
    measure, best = f"{shown['measure']}, in {unit}", shown["best"]
    if best["number"] is not None:
        measure += f"; the best is {best['value']:.3g} {unit} at trial {best['number']}"
    if "noise_floor_hz" in shown:
        measure += f"; the noise of a plant at rest, {shown['noise_floor_hz']:.3g} Hz, is subtracted"
        if shown["source"] != "estimate":
            measure += "; the identified lumps are means over the trials that the measure cannot tell from the best"
    return {
        "Plant": plant_words(found.spec),
        "Nominal model": nominal_words(study.nominal),
        "Sampler": f"{study.sampler}, seed {study.seed}, {f'{coordinates} coordinates, ' if coordinates else ''}"
        f"at most {plural(study.trials, 'trial')}",
        "Measure": measure,
        "Episode": episode_words(found.problem.episode, found.problem.timestep),
    }


def plant_picture(found: Findings) -> PageFigure:
    """A sketch of the plant, or of the nominal model where the plant is not to be shown."""
    plant = found.problem.open_plant() if shows_plant(found) else found.problem.robot.nominal_plant()
    drawn = (sketch(plant, found.problem.episode, width) for width in WIDTHS.values())
    return page_figure("plant", plant_caption(found), drawn)


def errors(found: Findings) -> list[dict[str, Any]]:
    """How wrong the nominal and the identified law are on states that no trial has seen, where that is known."""
    nominal, identified = found.nominal_error, found.summary["model_error"] or {}
    if nominal is None:
        return []
    rows = MODEL_ERRORS.items()
    return [{"name": name, "nominal": nominal[key], "identified": identified.get(key)} for key, name in rows]


def falls(trials: pd.DataFrame, total_steps: int) -> dict[str, Any]:
    """How many of the `trials` fell, how far they came of all steps of an episode, and when the last one was."""
    fallen = trials[trials["state"] == "PRUNED"]
    return {
        "count": len(fallen),
        "share": len(fallen) / max(len(trials), 1),
        "last": int(fallen["number"].iloc[-1]) if len(fallen) else None,
        "quartiles": [int(steps) for steps in fallen["steps"].quantile([0.25, 0.5, 0.75])] if len(fallen) else [],
        "total_steps": total_steps,
    }


def cost(trials: pd.DataFrame, timestep: float, reached: list[dict[str, Any]]) -> dict[str, Any]:
    """Trials and steps in all and until lumps were as near as was `reached`; the motion that took, in s."""
    total = int(trials["steps"].sum())
    return {"trials": len(trials), "steps": total, "seconds": total * timestep, "reached": reached}


def reached(found: Findings) -> list[dict[str, Any]]:
    """Trials and steps until every lump was within 10, 1 and 0.1 %."""
    if found.true_factors is None or found.nominal_error is not None:
        return []
    steps, rows = found.trials["steps"].cumsum(), []
    bests, wrong = found.bests, found.errors(found.bests)
    for digit in (0.1, 0.01, 0.001):
        within = np.flatnonzero(wrong <= digit)
        if len(within):
            number = int(bests["number"].iloc[within[0]])
            rows.append({"within": digit, "trials": number + 1, "steps": int(steps.loc[number])})
    return rows


def unidentified(found: Findings) -> dict[str, str]:
    """What this study does not determine, or determines only roughly, with the reason of each."""
    by_estimate, has_prior = found.verdict.source == "estimate", found.sought.deviations is not None
    who = "these trials do" if by_estimate else f"{found.problem.measure.name} with these pushes does"
    tenth = "what it is, or of what it may have been wrong by beforehand" if has_prior else "its value"
    what = f"its {found.interval_name} is" if by_estimate else "what cannot be told from the best trial differs by"

    def why(lump: dict[str, Any]) -> str | None:
        if found.verdict.word == "not found":
            return "not found: see the verdict"
        if not lump["determined"]:
            return f"{who} not know it to a tenth of {tenth}"
        if lump["identified"] is None:
            return "not found yet"
        if has_prior or lump["low"] is None:
            return None
        width = (lump["high"] - lump["low"]) / lump["identified"]
        return f"{what} {width:.1%} of its value" if width > WIDEST else None

    reasons = ((lump["name"], why(lump)) for lump in found.summary["lumps"])
    return {name: reason for name, reason in reasons if reason is not None}
