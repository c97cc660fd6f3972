"""A study as one self-contained HTML page: nothing is fetched, every value is escaped, figures are inline SVG.

Colours follow the reader's light or dark preference: matplotlib's ink becomes the page's. Each figure is there twice,
as wide as a page and as a phone, and the style sheet shows the one that fits.
"""

from __future__ import annotations

import io
import platform
import re
import shlex
from collections.abc import Iterable
from dataclasses import dataclass
from importlib import metadata
from typing import Any

import numpy as np
import pandas as pd
import tomli_w
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

import metaid
from metaid.plant import PlantSettings
from metaid.results import (
    Findings,
    body_rows,
    describe_known_from,
    describe_possible_bodies,
    describe_trials,
    interval_name,
    shown_rows,
)
from metaid.show.figures import COLUMN, INK, PAGE, Gallery, Picture, plant_figure, said_in, style, with_titles

VERSIONS_OF = ("mujoco-core", "numba", "numpy", "cmaes", "optuna", "matplotlib")
WIDEST = 0.02  # of a lump's value: a wider range is reported


@dataclass(frozen=True)
class PageFigure:
    """A figure ready for the page: `wide` and `narrow` SVG."""

    name: str
    caption: str
    wide: Markup
    narrow: Markup


def render(found: Findings) -> str:
    """The page.  Raises StorageError where there is no survivor yet."""
    gallery = Gallery(found)
    bodies = body_rows(found.problem, found.estimate, found.verdict)["bodies"]
    return filled_in(
        "report.html",
        found=found,
        summary=found.summary,
        lumps=shown_rows(found.summary),
        faults=shown_rows(found.summary, "faults"),
        study=found.spec.study,
        unit=found.problem.measure.unit,
        episode=found.problem.episode,
        timestep=found.problem.timestep,
        plant_picture=plant_picture(found),
        shows_plant=shows_plant(found),
        validation=None if found.validation is None else found.validation.summary(),
        left_out=gallery.left_out,
        figures=page_figures(gallery.pictures("page"), gallery.pictures("column")),
        falls=falls(found.trials, found.problem.episode.total_steps),
        cost=cost(found.trials, found.problem.timestep, reached(found)),
        unidentified=unidentified(found),
        estimate=estimate_texts(found.summary),
        bodies=bodies,
        describe_possible_bodies=describe_possible_bodies(bodies) if bodies else None,
        files=files(found),
        quoted_name=shlex.quote(found.name),
    )


def filled_in(template: str, **values: Any) -> str:
    """A page made of a `template` of this package and these `values`; what they say is escaped."""
    versions = {"metaid": metaid.__version__, "Python": platform.python_version(), **_versions()}
    page: str = templates().get_template(template).render({"versions": versions, **values})
    return re.sub(r"<table.*?</table>", _labelled, page, flags=re.DOTALL)


def templates() -> Environment:
    """Those of this package, in which every value is escaped."""
    environment = Environment(
        loader=PackageLoader("metaid.show", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"number": number_text, "percent": percent_text}
    return environment


def _labelled(table: re.Match[str]) -> str:
    """A table whose cells say of which column they are: a phone shows them below one another."""
    if "<thead>" not in table[0]:
        return table[0]
    headings = re.findall(r"<th>(.*?)</th>", table[0].partition("</thead>")[0])

    def row(found: re.Match[str]) -> str:
        names = iter(headings)
        return re.sub("<td>", lambda _: f'<td data-label="{next(names)}">', found[0])

    return re.sub(r"<tr>(<td>.*?)</tr>", row, table[0], flags=re.DOTALL)


def shows_plant(found: Findings) -> bool:
    """Whether the plant's own parameters may be shown: not of a rig, nor where its file has `truth_known = false`."""
    plant = found.spec.plant
    return isinstance(plant, PlantSettings) and plant.truth_known


def plant_picture(found: Findings) -> PageFigure:
    """A sketch of the plant, or of the nominal model where the plant is not to be shown."""
    plant = found.problem.make_plant() if shows_plant(found) else found.problem.nominal_plant()
    widths = {"wide": 0.64 * PAGE, "narrow": COLUMN}
    wide, narrow = (inline_svg(plant_figure(plant, width), f"plant-{name}-") for name, width in widths.items())
    caption = "The plant as it is simulated, bent a little at every joint. The search never sees these numbers."
    if not shows_plant(found):
        what = "A plant whose truth is not told" if found.problem.is_simulated else "A rig"
        caption = f"{what}, drawn by the nominal model, bent a little at every joint."
    return PageFigure("plant", caption, wide, narrow)


def page_figures(page: Iterable[Picture], column: Iterable[Picture]) -> list[PageFigure]:
    """The same figures at the width of a `page` and of a `column`, ready for the page."""
    return [
        PageFigure(
            wide.name,
            wide.caption,
            inline_svg(wide.figure, f"{wide.name}-wide-"),
            inline_svg(narrow.figure, f"{wide.name}-narrow-"),
        )
        for wide, narrow in zip(page, column, strict=True)
    ]


def inline_svg(figure: Figure, prefix: str) -> Markup:
    """A figure as SVG to stand in a page: no XML head, ids that begin with `prefix`, ink that the page chooses; values
    are shown where a mark is pointed at.

    The figure has its layout for good then. Else savefig would draw all of it once more, for the layout alone.
    """
    buffer, said = io.BytesIO(), said_in(figure)
    with style():
        FigureCanvasSVG(figure)  # letters are measured as SVG has them
        if (layout := figure.get_layout_engine()) is not None:
            layout.execute(figure)
            figure.set_layout_engine(None)
        figure.savefig(buffer, format="svg", facecolor="none", metadata={"Date": None})
    text = with_titles(buffer.getvalue().decode(), said)
    svg = re.sub(r"<metadata>.*?</metadata>", "", text[text.index("<svg") :], flags=re.DOTALL)
    svg = re.sub(r'\bid="', f'id="{prefix}', svg)
    svg = re.sub(r'(url\(#|href="#)', rf"\g<1>{prefix}", svg)
    # Its own output: no part of it but numbers and the study's checked names, which matplotlib has escaped.
    return Markup(svg.replace(INK, "currentColor"))


def estimate_texts(summary: dict[str, Any]) -> dict[str, str | None]:
    """What the estimate from all trials is worth by a `summary`, how early it was there, or why there is none."""
    shown, total = summary["estimate"], summary["trials"]["total"]
    if shown is None:
        return {"worth": f"No estimate: {summary['why_no_estimate']}.", "known": None, "interval": None}
    known = describe_known_from(shown, total).capitalize() + "." if shown["explains"] else None
    return {
        "worth": f"Estimate from {describe_trials(shown, total)}: {shown['description']}.",
        "known": known,
        "interval": interval_name(shown["counts"]),
    }


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
    if found.true_factors is None:
        return []
    steps, rows = found.trials["steps"].cumsum(), []
    bests, errors = found.bests, found.errors(found.bests)
    for digit in (0.1, 0.01, 0.001):
        within = np.flatnonzero(errors <= digit)
        if len(within):
            number = int(bests["number"].iloc[within[0]])
            rows.append({"within": digit, "trials": number + 1, "steps": int(steps.loc[number])})
    return rows


def unidentified(found: Findings) -> list[dict[str, Any]]:
    """Lumps that this study does not determine, or determines only roughly, each with the reason."""
    rows = []
    by_estimate = found.verdict.source == "estimate"
    for lump in found.summary["lumps"]:
        why = None
        if found.verdict.word == "not found":
            why = "not found: see the verdict"
        elif not lump["determined"]:
            who = "these trials do" if by_estimate else f"{found.problem.measure.name} with these pushes does"
            why = f"{who} not know it to a tenth of its value"
        elif lump["identified"] is None:
            why = "not found yet"
        elif lump["low"] is not None and (width := (lump["high"] - lump["low"]) / lump["identified"]) > WIDEST:
            what = (
                f"its {found.interval_name} is" if by_estimate else "what cannot be told from the best trial differs by"
            )
            why = f"{what} {width:.1%} of its value"
        if why is not None:
            rows.append({"name": lump["name"], "why": why})
    return rows


def files(found: Findings) -> dict[str, str]:
    """A plant file and a study file, by name, that make this very study again, trial for trial. Where the truth is not
    told, the plant file is the reader's own.
    """
    stem = file_stem(found.name)
    plant = found.spec.plant.model_dump(mode="json", exclude_none=True)
    links = [link.model_dump(mode="json", exclude_none=True) for link in found.spec.nominal]
    study = found.spec.study.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
    study |= {"plant": f"{stem}-plant.toml", "nominal": {"links": links}}
    if found.problem.is_simulated and not shows_plant(found):
        study["plant"] = f"{found.spec.plant_name}.toml"
        return {f"{stem}.toml": tomli_w.dumps(study)}
    return {f"{stem}-plant.toml": tomli_w.dumps(plant), f"{stem}.toml": tomli_w.dumps(study)}


def file_stem(name: str) -> str:
    """What a file may be called that is about the study of that `name`."""
    return re.sub(r"[^\w-]+", "-", name)


def _versions() -> dict[str, str]:
    return {package: metadata.version(package) for package in VERSIONS_OF}


def number_text(value: float | None, form: str = ".5g") -> str:
    """A number for the page; a dash where it is not known."""
    return "–" if value is None else format(value, form)


def percent_text(share: float | None) -> str:
    """A share as a percentage of two digits for the page, however small or large; a dash where it is not known."""
    return "–" if share is None else f"{float(f'{100.0 * share:.2g}'):g}%"
