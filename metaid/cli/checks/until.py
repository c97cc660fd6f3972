"""`--until`: how narrow intervals are to be, what that takes, and whether it was reached."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from metaid.study import Forecast


def share(context: click.Context, parameter: click.Parameter, value: str | None) -> float | None:
    """The share that an option has, as `0.5%` or 0.005.  Raises click.BadParameter where it is none."""
    if value is None:
        return None
    try:
        number = float(value.removesuffix("%")) * (0.01 if value.endswith("%") else 1.0)
    except ValueError:
        number = math.nan
    if not 0.0 < number < 1.0:
        wanted = f"'{value}' is no share (allowed: above 0 to below 1, as 0.5% or 0.005)"
        raise click.BadParameter(wanted, context, parameter)
    return number


def forecast_row(foreseen: Forecast) -> dict[str, Any]:
    """What a run until intervals are narrow takes, as JSON."""
    width = foreseen.half_width
    return {
        "half_width": foreseen.until,
        "is_reached": foreseen.is_reached,
        "trials": foreseen.trials,
        "pushes": foreseen.pushes,
        "minutes": foreseen.seconds / 60.0,
        "reached_half_width": width if math.isfinite(width) else None,
    }


def describe_forecast(foreseen: Forecast) -> str:
    """The same in a sentence."""
    cost = f"{foreseen.trials} trials, {foreseen.pushes} pushes, {foreseen.seconds / 60.0:.2g} min of motion"
    if foreseen.is_reached:
        return f"--until {foreseen.until:.3g}: if the nominal model were right, {cost} make every interval so narrow"
    if not math.isfinite(foreseen.half_width):
        return f"--until {foreseen.until:.3g}: not reached, for no estimate explains {cost} of the nominal model"
    return (
        f"--until {foreseen.until:.3g}: not reached, for after {cost} half the widest interval is still "
        f"{foreseen.half_width:.2g} of its lump: push harder, longer, or with more pushes"
    )


def describe_reached(shown: dict[str, Any], until: float) -> str:
    """Whether every interval of a study in its summary is as narrow as wanted, and if not, which is the widest."""
    widths = {
        lump["name"]: (lump["high"] - lump["low"]) / (2.0 * lump["identified"]) if lump["determined"] else math.inf
        for lump in shown["lumps"]
    }
    name, widest = max(widths.items(), key=lambda each: each[1])
    if widest <= until:
        return f"--until {until:.3g}: reached, half of every interval is at most {widest:.2g} of its lump"
    how = "it is not determined" if math.isinf(widest) else f"half its interval is {widest:.2g} of it"
    return f"--until {until:.3g}: not reached, the least known lump is {name}: {how}"
