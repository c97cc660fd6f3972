"""Pictures of the paper's tables, its Fig. 4 and the sweep of its f_m1, ours beside its own; each writes a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from metaid.paper.tables import FIG4_FACTOR, LIKE, PURE, run_fig4

DPI = 120
BLUE, RED, SKY = "#0072B2", "#D55E00", "#56B4E9"  # of Okabe and Ito, as all of metaid's figures have them


def draw_table(rows: list[dict[str, Any]], path: Path) -> None:
    """Periods of each link over the rows of a table, the paper's beside both readings'; rows that fall are shaded."""
    links = max(len(row["paper_periods"]) for row in rows)
    figure = Figure(figsize=(7.0, 2.2 + 1.6 * links), layout="constrained")
    axes = figure.subplots(links, 1, sharex=True, squeeze=False)[:, 0]
    places = range(len(rows))
    for link, plot in enumerate(axes):
        for key, label, marker, colour in (
            ("paper_periods", "paper", "o", "black"),
            ("periods", f"pure ({rows[0]['rule']})", "s", BLUE),
            ("complete_periods", "pure (complete)", "x", SKY),
            ("like_periods", f"paper-like, fitted ({rows[0]['like_rule']})", "^", RED),
        ):
            periods = [row[key][link] if row[key] else np.nan for row in rows]
            hollow = {"markerfacecolor": "none", "markersize": 9} if key == "paper_periods" else {"markersize": 5}
            plot.plot(places, periods, marker=marker, color=colour, label=label, linewidth=0.8, **hollow)
        for place in places:
            if rows[place]["falls"]:
                plot.axvspan(place - 0.5, place + 0.5, color="0.9")
                plot.text(place, 0.5, "falls", ha="center", transform=plot.get_xaxis_transform())
        plot.set(ylim=(-0.5, 1.08 * plot.get_ylim()[1]), ylabel=f"periods of link {link + 1}")
        plot.grid(alpha=0.3)
    axes[0].legend(frameon=False, fontsize=8)
    axes[-1].set_xticks(places, ["\n".join(f"{factor:.2f}" for factor in row["factors"].values()) for row in rows])
    axes[-1].set_xlabel("factor of " + ", ".join(rows[0]["factors"]))
    figure.savefig(path, dpi=DPI)


def draw_fig4(path: Path) -> None:
    """Both joint angles over the normalised steps, all factors 1.01, as in the paper's Fig. 4, by both readings."""
    figure = Figure(figsize=(7.0, 4.6), layout="constrained")
    axes = figure.subplots(2, 1, sharex=True)
    for label, reading, colour in (("pure", PURE[2], BLUE), ("paper-like, fitted", LIKE[2], RED)):
        angles, periods = run_fig4(reading)
        degrees = np.degrees(np.pi - (np.pi - angles) % (2.0 * np.pi))
        degrees[1:][np.abs(np.diff(degrees, axis=0)) > 180.0] = np.nan  # no line across where the angle wraps
        for joint, plot in enumerate(axes):
            steps = np.linspace(0.0, 1.0, len(degrees))
            text = f"{label}: {periods[joint]} periods by {reading.rule}"
            plot.plot(steps, degrees[:, joint], color=colour, linewidth=0.8, label=text)
    for joint, plot in enumerate(axes):
        plot.set(ylabel=f"θ{joint + 1}, degrees", ylim=(-185, 185))
        plot.set_yticks(range(-180, 181, 90))
        plot.grid(alpha=0.3)
        plot.legend(framealpha=0.95, loc="upper left", ncols=2, fontsize=8)
    axes[0].set_title(f"All factors {FIG4_FACTOR}; the paper's Fig. 4 has 5 and 15 periods", loc="left", fontsize=10)
    axes[-1].set_xlabel("normalised steps (of 5,000)")
    figure.savefig(path, dpi=DPI)


def draw_sweep(rows: list[dict[str, Any]], path: Path) -> None:
    """Counts and frequency of both links over the factor of the Coriolis lump, whose true value is 1."""
    factors = [row["factors"]["coriolis_1_2"] for row in rows]
    figure = Figure(figsize=(7.0, 4.6), layout="constrained")
    counts, frequency = figure.subplots(2, 1, sharex=True)
    for joint in range(2):
        link = f"link {joint + 1}"
        for key, label, marker in (("periods", "pure, small push", "s"), ("like_periods", "paper-like, fitted", "^")):
            style = {"marker": marker, "color": (BLUE, RED)[joint], "linewidth": 0.8, "markersize": 4}
            counts.plot(factors, [row[key][joint] for row in rows], label=f"{link}, {label}", **style)
        hertz = np.array([row["frequency_hz"][joint] for row in rows])
        change = 1e2 * (hertz / hertz[len(hertz) // 2] - 1.0)
        frequency.plot(factors, change, color=(BLUE, RED)[joint], label=f"{link}, pure, small push")
    counts.set(ylabel="periods in 5,000 steps", ylim=(0, 24))
    frequency.set_ylabel("frequency against\nthat at 1, %")
    frequency.set_xlabel("factor of coriolis_1_2 (f_m1); gravity factors 1.01")
    for plot in (counts, frequency):
        plot.axvline(1.0, color="0.5", linestyle=":")
        plot.grid(alpha=0.3)
        plot.legend(frameon=False, fontsize=8, ncols=2)
    figure.savefig(path, dpi=DPI)
