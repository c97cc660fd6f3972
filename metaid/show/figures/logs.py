"""What logs say of a robot: torques that were left out, friction, gravity torque, and bodies beside nominal ones.

What is `found` in logs is what `metaid.estimate` returns.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from metaid.models import DEVIATIONS, Array
from metaid.recorded import LeftOut, RecordedResult, friction_curves, gravity_curves
from metaid.show.figures.style import COLOURS, INK, RANGE, SURVIVOR, new_axes, say_at, verbatim

SHOWN = 16.0  # s of motion in a figure: of more each part shows a stretch from its middle
SPEEDS = np.linspace(0.01, 1.0, 40)  # shares of a joint's fastest speed
MEASURED, PREDICTED, NOMINAL = INK, COLOURS[1], COLOURS[2]


def plot_predicted_torque(found: RecordedResult, joint: int, axes: Axes | None = None) -> Axes:
    """The torque of a `joint`, from 0 on, that was measured and what was predicted of it, in N m (N), over time in s:
    of what was left out, one part after the other between dotted lines. Of one without a motor it is that of gravity,
    and what is predicted to cancel it.
    """
    axes = new_axes(axes)
    times, measured, predicted = _over_time(found.left_out, joint, axes)
    axes.plot(times, measured, color=MEASURED, linewidth=1.0, label="measured")
    axes.plot(times, predicted, color=PREDICTED, linewidth=1.0, linestyle="--", label="predicted")
    what = "gravity's torque" if found.estimate.model.passive[joint] else "torque"
    axes.set_ylabel(f"{what}, {_unit(found, joint)}")
    return axes


def plot_torque_residuals(found: RecordedResult, joint: int, axes: Axes | None = None) -> Axes:
    """The torque of a `joint`, from 0 on, that was measured less what was predicted of it, in N m (N), over time in s,
    as `plot_predicted_torque` has it.
    """
    axes = new_axes(axes)
    times, measured, predicted = _over_time(found.left_out, joint, axes)
    axes.plot(times, measured - predicted, color=SURVIVOR, linewidth=0.8)
    axes.axhline(0.0, color=INK, linewidth=0.5)
    axes.set_ylabel(f"residual, {_unit(found, joint)}")
    return axes


def plot_friction(found: RecordedResult, joint: int, axes: Axes | None = None) -> Axes:
    """The friction of a `joint`, from 0 on, in N m (N), over its speed, in rad/s (m/s); in the band it is with 95 %."""
    axes = new_axes(axes)
    curve = friction_curves(found.estimate, SPEEDS.tolist())[joint]
    _band(axes, curve.speed, curve.torque, curve.sd)
    axes.set_xlabel("speed, m/s" if found.estimate.model.slides[joint] else "speed, rad/s")
    axes.set(ylabel=f"friction, {_unit(found, joint)}", xlim=(0.0, curve.speed[-1]))
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    return axes


def plot_gravity(found: RecordedResult, joint: int, axes: Axes | None = None) -> Axes:
    """The torque that holds a `joint`, from 0 on, against gravity that loads it, in N m (N), where it alone turns and
    the others are at the middle of their angles, in rad (m); in the band it is with 95 %, dashed is that of the nominal
    bodies.
    """
    axes = new_axes(axes)
    model = found.estimate.model
    curve = next(each for each in gravity_curves(found.estimate) if each.joint == model.joints[joint])
    _band(axes, curve.angle, curve.torque, curve.sd)
    axes.plot(curve.angle, curve.nominal, color=NOMINAL, linestyle="--", label="nominal")
    axes.set_xlabel("coordinate, m" if model.slides[joint] else "angle, rad")
    axes.set_ylabel(f"gravity torque, {_unit(found, joint)}")
    return axes


def plot_bodies(found: RecordedResult, axes: Axes | None = None) -> Axes:
    """By how much what logs say of the bodies and their rotors differs from the nominal ones, as a share of what these
    may have been wrong by beforehand (one standard deviation), with 95 % intervals.
    """
    axes = new_axes(axes)
    estimate, model = found.estimate, found.estimate.model
    scales = estimate.scale * np.sqrt(np.maximum(np.diag(model.covariance), 1e-300))
    moved = (estimate.values[: model.nbody] - estimate.scale * model.nominal) / scales
    reach = DEVIATIONS * estimate.deviations[: model.nbody] / scales
    rows = np.arange(model.nbody)
    axes.errorbar(moved, rows, xerr=reach, fmt="o", markersize=3, color=INK, ecolor=RANGE, linewidth=0, elinewidth=2)
    axes.axvline(0.0, color=NOMINAL, linestyle="--", linewidth=0.8, label="nominal")
    values = zip(model.names, estimate.values.tolist(), estimate.deviations.tolist(), model.units, strict=False)
    texts = [f"{name}: {value:.4g} ± {sd:.2g} {unit}" for name, value, sd, unit in values]
    say_at(axes, moved, rows, texts[: model.nbody])
    axes.set_yticks(rows, [verbatim(name) for name in model.names[: model.nbody]])
    axes.set(ylim=(model.nbody - 0.5, -0.5), xlabel="change from nominal ÷ its prior deviation")
    axes.grid(True, axis="x")
    return axes


def _band(axes: Axes, where: Array, torque: Array, sd: Array) -> None:
    reach = DEVIATIONS * sd
    axes.fill_between(where, torque - reach, torque + reach, color=RANGE, alpha=0.45, linewidth=0, label="95 %")
    axes.plot(where, torque, color=INK, label="identified")
    axes.axhline(0.0, color=INK, linewidth=0.5)
    axes.grid(True)


def _unit(found: RecordedResult, joint: int) -> str:
    return "N" if found.estimate.model.slides[joint] else "N m"


def _over_time(parts: Sequence[LeftOut], joint: int, axes: Axes) -> Array:
    """Times, in s, measured and predicted torques (3 x nrow) of all parts one after the other, NaN between them; draws
    what is between them.
    """
    begun, shown = 0.0, list[Array]()
    for part in parts:
        every = np.flatnonzero(part.judged)
        if not len(every):
            continue
        period = float(part.times[1] - part.times[0])
        kept = max(round(SHOWN / len(parts) / period), 2)
        spans = np.split(every, np.flatnonzero(np.diff(every) > kept) + 1)
        rows = max(spans, key=len)  # of spans far apart the longest
        first = max((len(rows) - kept) // 2, 0)
        rows = np.arange(rows[first], min(rows[first] + kept, rows[-1] + 1))
        if begun:
            axes.axvline(begun, color=INK, linewidth=0.5, linestyle=":")
        times = begun + part.times[rows] - part.times[rows[0]]
        torques = np.stack([part.measured, part.predicted])[:, rows, joint]
        shown += [np.vstack([times, np.where(part.judged[rows], torques, np.nan)]), np.full((3, 1), np.nan)]
        begun = float(times[-1]) + period
    axes.set(xlim=(0.0, max(begun, 1e-3)), xlabel="time of what was left out, s")
    axes.grid(True)
    return np.concatenate(shown, axis=1)
