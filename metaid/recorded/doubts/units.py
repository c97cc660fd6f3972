"""Joints whose torques are in another unit than those of the others, by what their nominal bodies need."""

from __future__ import annotations

import numpy as np

from metaid.models import Array
from metaid.recorded.doubts.conventions import NAMED, Check, Fact
from metaid.recorded.doubts.scales import UNIT, scales_of
from metaid.recorded.given import Option
from metaid.recorded.weak_form.equations import Equations

SAME = 0.005  # of the torque: less that is unexplained tells nothing
THOUSANDS = (1000.0, 0.001)
FRICTION = 50.0  # times the torque of a joint's bodies that its friction may be
LIGHT = 0.02  # of the strongest joint's torque, for a joint that bodies hardly load


def units_of(check: Check) -> dict[int, tuple[float, Fact]]:
    """Joints, from 0 on, whose torques are so many times what the nominal bodies need that they are in another unit
    than those of the others, each with the factor that mends it; 1 where the other joints say that it is the bodies.
    """
    units: dict[int, tuple[float, Fact]] = {}
    names = check.equations.model.joints
    ratios = _ratios(check.equations)
    factors = np.ones(len(names))
    for joint, ratio in ratios.items():
        factors[joint] = next((1.0 / unit for unit in THOUSANDS if 0.3 < ratio / unit < 3.0), 1.0 / ratio)
    for joint, ratio in ratios.items():
        factor = float(factors[joint])
        if _is_confirmed(check, joint, factors):
            text = (
                f"joint {names[joint]} needs {ratio:.3g} times the torque that the nominal bodies do, as other joints"
            )
            units[joint] = 1.0, Fact((f"{text} confirm: these bodies are wrong, not its unit",))
            continue
        unit = {0.001: "mN m", 1000.0: "kN m"}.get(factor, "a motor current or another unit")
        text = f"the torque of joint {names[joint]} is {ratio:.3g} times what the others' scale would make it: {unit}? "
        units[joint] = factor, Fact((text, (Option("scale", names[joint], factor),)))
    return units


def _is_confirmed(check: Check, joint: int, factors: Array) -> bool:
    """Whether any joint is explained far worse once the torque of one, from 0 on, is multiplied as well, beside the
    others that are in doubt, by `factors` (njoint): bodies that one joint carries are moved by the others, too.
    """
    mended = check.with_torques(factors).free
    kept = check.with_torques(np.where(np.arange(len(factors)) == joint, 1.0, factors)).free
    return bool((NAMED * mended > np.maximum(kept, SAME)).any())


def _ratios(equations: Equations) -> dict[int, float]:
    """Joints, from 0 on, whose torques are so many times what the others' scale would make them."""
    ratios = {}
    signed = scales_of(equations).joined
    known = signed[np.isfinite(signed)]
    # A joint that needs the other sign than most is wrong in another way than by its unit.
    scales = np.where(signed * np.median(known) > 0.0, np.abs(signed), np.nan) if len(known) else signed
    middle = float(np.median(np.abs(known))) if len(known) > 2 else equations.scale
    for joint, scale in enumerate(scales.tolist()):
        if equations.model.untrusted[joint]:
            continue
        ratio = scale / middle if np.isfinite(scale) else _beyond_friction(equations, joint)
        if not 1.0 / UNIT < ratio < UNIT:
            ratios[joint] = ratio
    return ratios


def _beyond_friction(equations: Equations, joint: int) -> float:
    """By how much the torques of a joint whose bodies are hardly felt are larger than friction can make them, which may
    be some times what another joint is sent; 1 where they are not.
    """
    model = equations.model
    needed = [(own[..., : model.nbody] @ (equations.scale * model.nominal)) for own in equations.columns]
    usual = np.sqrt(np.mean([(each**2).mean(axis=(0, 1)) for each in needed], axis=0))
    sent = np.sqrt(np.mean([(each**2).mean(axis=(0, 1)) for each in equations.torques], axis=0))
    most = FRICTION * max(float(usual[joint]), LIGHT * float(usual.max()))
    most = max(most, UNIT * float(np.delete(sent, joint).max(initial=0.0)))
    return float(sent[joint] / most) * UNIT if sent[joint] > most > 0.0 else 1.0
