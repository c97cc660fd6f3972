"""The command `metaid excite`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import metaid
from metaid.cli.common import PATH, json_option, numbers, print_json, print_table, refuse_output, say, whole_file
from metaid.errors import joints_of, unknown
from metaid.frames import number_text

if TYPE_CHECKING:
    from metaid.excitation import Excitation, LogNoise

FEW = 12  # parameters that a screen has


@click.command(epilog="\b\nExample:\n  metaid excite double-pendulum --seconds 20 -o motion.csv -o motion.yaml")
@click.argument("nominal", metavar="ROBOT")
@click.option("--seconds", type=float, default=30.0, show_default=True, help="Of the motion, 4 to 600.")
@click.option("--limits", type=PATH, metavar="FILE.toml", help="low, high, speed, torque, …")
@click.option("--noise", metavar="KEY=NUMBER", multiple=True, help="Of the log: angle in rad, torque as a share.")
@click.option("--rate", type=click.FloatRange(1.0, 2000.0), default=250.0, show_default=True, help="Rows a second.")
@click.option("--seed", type=click.IntRange(0), default=1, show_default=True, help="Of the search.")
@click.option("-o", "outputs", type=PATH, multiple=True, help="FILE.csv, or .yaml (ROS 2 JointTrajectory).")
@click.option("--all", "whole", is_flag=True, help="Print every parameter.")
@json_option
def excite(
    nominal: str,
    seconds: float,
    limits: Path | None,
    noise: tuple[str, ...],
    rate: float,
    seed: int,
    outputs: tuple[Path, ...],
    whole: bool,
    as_json: bool,
) -> None:
    """Find the motion to record, and say how well a log of it will show each parameter.

    It is periodic, from rest to rest, within limits of position, speed, acceleration and torque, and free of contacts;
    of all such motions one that shows base parameters and friction best. ROBOT is a plant's name, a plant file, an MJCF
    or URDF. Limits that nobody says are usual ones, and are printed with `--json`.
    """
    from metaid.excitation import SUFFIXES, write_motion

    for output in outputs:
        refuse_output(output, SUFFIXES)
    found = metaid.excite(nominal, seconds=seconds, limits=limits, noise=_noise(noise), seed=seed)
    for output in outputs:
        with whole_file(output, SUFFIXES) as partial:
            write_motion(found, partial, rate)
    if as_json:
        print_json(found.summary)
    else:
        _print(found, whole)
        for output in outputs:
            say(f"{output}: {found.seconds:g} s; bring the robot to its first row, at rest, by another way")


def _noise(given: tuple[str, ...]) -> LogNoise:
    from metaid.excitation import LogNoise

    values = numbers(given, "--noise")
    for name, value in values.items():
        if name not in ("angle", "torque"):
            raise click.UsageError(f"--noise: {unknown('key', name, ['angle', 'torque'])}")
        if not 0.0 <= value <= 1.0:
            raise click.UsageError(f"--noise {name}: {value:g} (allowed: 0 to 1)")
    return LogNoise(**values)


def _print(found: Excitation, whole: bool) -> None:
    rows = [
        [
            each["name"],
            number_text(each["nominal"]),
            f"± {each['sd']:.2g}",
            "yes" if each["determined"] else "NO",
            each["unit"],
        ]
        for each in found.parameters
    ]
    left = 0 if whole else max(len(rows) - FEW, 0)
    print_table(
        f"{found.plant}: what a log of {found.seconds:g} s will show",
        ["parameter", "nominal", "sd", "to a tenth", "unit"],
        rows if whole else rows[:FEW],
        f"{left} more parameters: --all" if left else "",
        words=["to a tenth", "unit"],
    )
    for line in _lines(found):
        say(line)


def _lines(found: Excitation) -> list[str]:
    """What it comes to, a sentence a line."""
    from metaid.models import COARSEST

    told, count = found.forecast, int(found.forecast.determined.sum())
    lines = [
        f"{count} of {len(told.determined)} parameters will be known to a tenth; "
        + (
            f"the torque of {joints_of(told.unknown)} to no better than a tenth"
            if told.unknown
            else "the torque of every joint to a tenth or better"
        ),
        f"a second, different motion as long multiplies deviations by {_median(found.second)} in the middle, the same "
        f"once more by {_median(found.again)}",
    ]
    if found.payload is not None:
        mass, gains = found.payload
        shown = [
            f"{name} {gain:.1%}" if gain < COARSEST else f"{name} not"
            for name, gain in zip(found.joints, gains.tolist(), strict=True)
        ]
        lines.append(
            f"no log shows a wrong constant of a drive; the same motion once more with {mass:g} kg at the last link "
            f"tells the gain of {joints_of(shown)}"
        )
    else:
        lines.append("contacts are not looked at, for links of a chain have no shapes")
    return lines


def _median(shares: Any) -> str:
    return f"{sorted(shares.tolist())[len(shares) // 2]:.2f}"
