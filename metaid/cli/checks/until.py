"""`--until`: how well all lumps are to be known, what that takes, and whether it was reached."""

from __future__ import annotations

import math
from typing import Any

import click


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


def describe_forecast(foreseen: dict[str, Any]) -> str:
    """What a run until all lumps are known takes, as `check --json` has it, in a sentence."""
    head, width = f"--until {foreseen['half_width']:.3g}: ", foreseen["reached_half_width"]
    cost = f"{foreseen['trials']} trials, {foreseen['pushes']} pushes, {foreseen['minutes']:.3g} min of motion"
    if foreseen["is_reached"]:
        return f"{head}if the nominal model were right, {cost} are enough"
    if width is None:
        return f"{head}not reached, for no estimate explains {cost} of the nominal model"
    return (
        f"{head}not reached, for after {cost} the least known is known to {width:.2g} of it: push harder, longer, or "
        "with more pushes"
    )


def describe_reached(shown: dict[str, Any], until: float) -> str:
    """Whether all lumps of a study in its summary are known as well as wanted, and if not, which is the least known; of
    an arm the torques of its joints.
    """
    head = f"--until {until:.3g}: "
    known = None if shown["estimate"] is None else shown["estimate"]["half_width"]
    if known is None:
        return f"{head}not reached, nothing was found"
    if all("expression" in lump for lump in shown["lumps"]):
        what = f"with 95 % the torque of each joint is within {known:.2g} of what was found"
        return f"{head}{'reached' if known <= until else 'not reached'}, {what}"
    loose = next((lump["name"] for lump in shown["lumps"] if not lump["determined"]), None)
    if loose is not None:
        return f"{head}not reached, {loose} is not determined"
    if known <= until:
        return f"{head}reached, with 95 % all lumps at once are within {known:.2g} of what was found"
    name = max(shown["lumps"], key=lambda lump: lump["high"] / lump["low"])["name"]
    return f"{head}not reached, the least known lump is {name}, which is known to {known:.2g} of it"
