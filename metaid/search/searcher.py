"""What every searcher answers to: `ask` for a generation, `tell` what became of it. One whose sampler `widens` also
answers to `widen`: from the next generation on its candidates are within the bounds of other coordinates, which are
otherwise the same.

A generation's size belongs to the study, not to the number of workers. So the trials are the same whoever evaluates
them. A fall has a value above every survivor's (Eq. 18). Its outcome also says that it is a fall.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Protocol

from pydantic import Field

from metaid.episode import Outcome
from metaid.files import Settings
from metaid.models import Array


class StepOptions(Settings):
    """`generation`: how many candidates a generation has (default: the sampler's own number); `sigma`: the first step,
    in the coordinates' own unit.
    """

    generation: Annotated[int, Field(ge=2, le=100_000)] | None = None
    sigma: Annotated[float, Field(gt=0, le=10)] = 0.2


class Searcher(Protocol):
    """Proposes factors and learns from outcomes, generation by generation."""

    @property
    def spread(self) -> float | None:
        """How far its next candidates are apart, roughly and in its own coordinates; None where it does not know."""

    def ask(self) -> Array:
        """The next generation's factors (ncandidate x nlump)."""

    def tell(self, outcomes: Sequence[Outcome]) -> None:
        """What became of them, in the same order."""

    def finished(self) -> bool:
        """Whether it cannot improve any more."""
