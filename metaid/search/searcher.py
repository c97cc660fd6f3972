"""What every searcher answers to: `ask` for a generation, `tell` what became of it.

A generation's size belongs to the study, not to the number of workers. So the trials are the same whoever evaluates
them. A fall has a value above every survivor's (Eq. 18). Its outcome also says that it is a fall.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Protocol, runtime_checkable

from pydantic import Field

from metaid.episode import Outcome
from metaid.files import Settings
from metaid.models import Array
from metaid.search.coordinates import Coordinates


class GenerationOptions(Settings):
    """`generation`: how many candidates a generation has (default: the sampler's own number)."""

    generation: Annotated[int, Field(ge=2, le=100_000)] | None = None


class StepOptions(GenerationOptions):
    """`sigma`: the first step, in the coordinates' own unit."""

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


@runtime_checkable
class WideningSearcher(Searcher, Protocol):
    """One that can go on within wider bounds, with all that it has learned."""

    def widen(self, coordinates: Coordinates) -> None:
        """From the next generation on candidates are within the bounds of these `coordinates`, which are otherwise the
        same.
        """
