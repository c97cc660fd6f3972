"""The error of every method against the seconds of motion that it had, as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from benchmarks.rivals.answers import EXACT, Result, medians, name_of
from benchmarks.rivals.comparing import METHODS, OURS
from benchmarks.rivals.conditions import CONDITIONS
from benchmarks.rivals.subjects import ARMS

PANEL = 3.1, 2.6  # inches
COLUMNS = 4


def draw(results: Sequence[Result], links: int) -> Figure:
    """Medians over the chains of so many `links` and those of each arm, a panel for each condition."""
    shown = [
        (name, number)
        for number in (links, *ARMS)
        for name in CONDITIONS
        if any(_is_of(each, name, number) for each in results)
    ]
    rows = -(-len(shown) // COLUMNS)
    figure = Figure(figsize=(PANEL[0] * COLUMNS, PANEL[1] * rows + 1.0), layout="constrained")
    panels = figure.subplots(rows, COLUMNS, sharey=True, squeeze=False).ravel()
    for panel, (condition, number) in zip(panels, shown, strict=False):
        own = [each for each in results if _is_of(each, condition, number)]
        budgets = sorted({each.cell.budget for each in own})
        middle = {budget: medians(own, (number, budget)) for budget in budgets}
        for place, method in enumerate(METHODS):
            known = [budget for budget in budgets if np.isfinite(middle[budget].get(method, np.inf))]
            errors = [100.0 * float(np.clip(middle[budget][method], EXACT, 1.0)) for budget in known]
            is_ours = method == OURS
            style = {"color": "black" if is_ours else f"C{place - 1}", "linewidth": 2.5 if is_ours else 1.2}
            style["linestyle"] = "--" if method.startswith("mujoco") else "-"
            panel.plot(known, errors, marker="o", markersize=4 if is_ours else 3, label=method, **style)
        panel.set_title(condition if number == links else f"{name_of(number)}, {condition}", fontsize=9)
        panel.set_xlabel("seconds of motion", fontsize=8)
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.set_xticks(budgets, [str(budget) for budget in budgets])
        panel.minorticks_off()
        panel.grid(alpha=0.3)
    for panel in panels[len(shown) :]:
        panel.set_visible(False)
    figure.supylabel("largest error, %")
    figure.legend(
        *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8, frameon=False
    )
    return figure


def save(results: Sequence[Result], links: int, path: Path) -> None:
    """Writes the picture as PNG, in few colours."""
    draw(results, links).savefig(path, dpi=85)
    Image.open(path).convert("RGB").quantize(64, dither=Image.Dither.NONE).save(path, optimize=True)


def _is_of(result: Result, condition: str, links: int) -> bool:
    return result.cell.condition == condition and result.cell.links == links
