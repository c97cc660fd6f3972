"""The estimate where nothing explains what was seen with what is searched: with the faults that do, and where none do,
with noise of the torques for what the model has not.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from metaid.estimation.estimate import Found
from metaid.estimation.faults import Proposal, TakenUp, fault_sizes, named_faults
from metaid.estimation.fit import fit
from metaid.estimation.noisy.combining import combine
from metaid.estimation.noisy.held_out import not_led
from metaid.estimation.noisy.innovations import led_by
from metaid.estimation.noisy.readings import Readings
from metaid.estimation.noisy.torque_noise import fit_with_torque_noise
from metaid.estimation.noisy.tried import Tried, farthest_moved
from metaid.models import Array

FAR = 0.2  # of the misfit before: faults with which it falls less are hardly what is missing


def take_up(readings: Readings, estimate: Found) -> tuple[Found, TakenUp | None]:
    """The `estimate` of some `readings`, with faults or without, with the faults that together predict pushes best that
    were left out, and what speaks for these; None where none was needed, or none helps.
    """
    combined = combine(readings, estimate)
    if combined is None:
        return estimate, None
    tried, others = combined
    faulty = replace(readings, faults=tried.faults)
    found = explained(faulty, tried.found) or led(faulty, tried.found)
    kinds = tuple(kind for kind in tried.kinds if kind not in readings.faults.kinds)
    if found is None or not kinds:
        return found or estimate, None
    assert found.faults is not None
    rivals = {words: shifts for words, shifts in (_rival(tried, other, readings) for other in others) if words}
    shifts = np.concatenate([np.empty((0, len(found.unknowns))), *rivals.values()])
    sizes = fault_sizes(kinds, found.faults)
    return found, TakenUp(kinds, sizes, _without(readings, estimate), found.misfit, tuple(rivals), shifts)


def proposed_faults(readings: Readings, estimate: Found, declared: float) -> Proposal | None:
    """The faults that together predict pushes better that were left out than an `estimate` of the `readings` does, were
    they searched; None where none does. The torques have a delay of so many s `declared` already.
    """
    found, taken_up = take_up(readings, estimate)
    if taken_up is None or found.faults is None or not (found.is_explained or found.misfit < FAR * estimate.misfit):
        return None
    sizes = fault_sizes(taken_up.kinds, found.faults, declared)
    return Proposal(taken_up.kinds, sizes, estimate.misfit, found.misfit, found.faults.searched.kinds)


def explained(readings: Readings, begin: Found) -> Found | None:
    """The fit without noise of torques, from where one with it ended; None where it does not explain the readings."""
    found: Found | None = fit(readings, begin.start, -1, explains=True)
    return found if found is not None and found.is_explained else None


def led(readings: Readings, begin: Found) -> Found | None:
    """The fit with noise of torques in place of what the model has not, from where another ended; None where the twin
    cannot follow. Its misfit is that of the twin without that noise.
    """
    noise = readings.some_torque if begin.torque_noise is None else begin.torque_noise
    found = fit_with_torque_noise(led_by(readings), begin.start, noise)
    return None if found is None else not_led(readings, found, found.point)


def _without(readings: Readings, estimate: Found) -> float:
    """The misfit of the fit without the faults that an `estimate` has; inf where the twin cannot follow."""
    if estimate.faults is None:
        return estimate.misfit
    found = fit(readings, estimate.unknowns, -1)
    return np.inf if found is None else float(found.misfit)


def _rival(best: Tried, other: Tried, readings: Readings) -> tuple[str, Array]:
    """An `other` explanation than the `best`, in words, nothing where it has the same lumps, and by how much unknowns
    change with it (n x nunknown).
    """
    shift, hidden = (other.found.unknowns - best.found.unknowns)[None], _hidden(other, readings)
    faults, is_alike = other.found.faults, farthest_moved(best.found, other.found) is None
    if faults is None or (is_alike and not len(hidden)):
        return "", shift
    return named_faults(other.kinds, fault_sizes(other.kinds, faults)), np.concatenate([shift, hidden])


def _hidden(tried: Tried, readings: Readings) -> Array:
    """By how much unknowns change (1 x nunknown) where the last encoder, whose offset no motion shows, is off by as
    much as the others are in a fit; none (0 x nunknown) where these are not, or where it changes nothing.
    """
    faults, none = tried.found.faults, np.empty((0, len(tried.found.unknowns)))
    if faults is None or "offset" not in tried.kinds or readings.unknowns.njoint < 2:
        return none
    direction = readings.unknowns.hides_offset(tried.found.unknowns)
    names, values = faults.searched.names, np.abs(faults.values)
    others = [values[names.index(f"offset_{joint}")] for joint in range(1, readings.unknowns.njoint)]
    return none if direction is None else max(others) * direction[None]
