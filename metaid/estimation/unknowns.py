"""What is unknown of a robot, whichever parameters it is told by."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar, Protocol

from metaid.models import Array


class Unknowns(Protocol):
    """Numbers z (nunknown) from which the parameters of a robot follow. Beforehand they are independent and normal
    about 0, where the robot is the nominal one.

    Attributes:
        tilts: about how many axes the base may be tilted.
        builds_up: whether their dry friction builds up over an angle where the plant moves continuously.
        leads_on: whether all trials lead on in a step or two from where the first of them led.
        ends_when_cut: whether a descent ends with a short step though it was cut, for longer windows may lead on.
        least_gain: of the cost of noisy readings; a step that promises less is not made.
        rounding: what it leaves between two simulations, as a share of the largest quantity seen.
        scale: what the unknowns are multiples of.
    """

    tilts: ClassVar[int]
    builds_up: ClassVar[bool]
    leads_on: ClassVar[bool]
    ends_when_cut: ClassVar[bool]
    least_gain: ClassVar[float]
    rounding: ClassVar[float]
    scale: ClassVar[float]

    @property
    def names(self) -> list[str]:
        """Of the unknowns (nunknown)."""

    @property
    def spread(self) -> float:
        """Standard deviation of each unknown, beforehand."""

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of lumps, or of parameters that a force may be taken for, among the unknowns."""

    @property
    def njoint(self) -> int: ...
    @property
    def joints(self) -> tuple[str, ...]:
        """What the joints are called (njoint)."""

    @property
    def begin(self) -> Array | None:
        """Where a fit begins (nunknown); None for the nominal robot."""

    @property
    def inertia(self) -> Array:
        """About what each joint needs (njoint) for an acceleration of 1 rad/s², in N m s²."""

    def torques(self, speed: float, /) -> Array:
        """About what each joint needs (njoint), in N m, at a `speed` in rad/s."""

    def alone(self, point: Array, /) -> Unknowns:
        """The robot there (nunknown), of which nothing is unknown any more."""

    def misplaced(self, point: Array, step: float, /) -> Iterator[tuple[int, Unknowns, float]]:
        """Each joint, the robot there (nunknown) with that joint a `step`, in m or rad, beside where it is said to be,
        of which nothing is unknown any more, and how far it may be from there, a standard deviation. None where
        geometry is unknown itself.
        """

    def hides_offset(self, point: Array, /) -> Array | None:
        """By how much the unknowns there (nunknown) change per rad that the encoder of the last joint reads too much,
        if nothing is to move otherwise; None where some offset shows.
        """

    def nearest(self, point: Array, covariance: Array, /) -> Array | None:
        """The unknowns (nunknown) that a plant can have and that cost least, from those of a free fit (nunknown) and
        their `covariance` (nunknown x nunknown); None where a plant can have these.
        """

    def estimated(self, **found: Any) -> Any:
        """The estimate with the fields of a `Found` that a fit has `found`."""
