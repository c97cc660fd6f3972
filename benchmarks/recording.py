"""What the methods that know the torques see: a recording of a chain, and derivatives of noisy angles by a filter."""

from __future__ import annotations

from dataclasses import dataclass

from scipy.signal import savgol_filter

from metaid.models import Array

# The best of the spans and motions that were tried on these chains, so that the noisy rows are not a strawman:
FILTER_SPAN, FILTER_ORDER = 1.5, 5  # of the derivatives' filter, in natural times, and of its polynomial


@dataclass(frozen=True)
class Recording:
    """Joint `angles` (rad), `speeds` (rad/s), `accelerations` (rad/s²) and `torques` (N m), each (nrun x nsteps x
    njoint), at every `timestep` (s)."""

    angles: Array
    speeds: Array
    accelerations: Array
    torques: Array
    timestep: float


def filtered(angles: Array, torques: Array, timestep: float, scale: float, span: float = FILTER_SPAN) -> Recording:
    """A recording of noisy `angles` (rad) and commanded `torques` (N m), (nrun x nsteps x njoint): derivatives by
    Savitzky-Golay, which lags nowhere, over a `span` in units of the natural time `scale`, in s.

    The torques pass through the same filter.
    """
    window = max(round(span * scale / timestep), FILTER_ORDER + 2) | 1

    def smooth(signal: Array, derivative: int = 0) -> Array:
        result: Array = savgol_filter(signal, window, FILTER_ORDER, derivative, timestep, axis=1)
        return result

    return Recording(smooth(angles), smooth(angles, 1), smooth(angles, 2), smooth(torques), timestep)
