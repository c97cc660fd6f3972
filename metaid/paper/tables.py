"""The paper's tables and its Fig. 4, run again beside what it printed.

R. S. Jamisola Jr. and E. P. Dadios, "Full Dynamics Identification of Multi-Link Inverted Pendulum: Analysis and
Implementation". Its numbers are in `table1.csv` and `table2.csv`. It gives neither masses, lengths, step, push nor
counting rule, so there are two readings of it. `PURE` is correct dynamics with the few settings that the paper leaves
open. `LIKE` is fitted to its 23 numbers, with a fault and a spring that the paper does not have: it shows what would
make them.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from metaid.episode import FALL_MARGIN, Episode, FallRule, crossing_hz, whole_periods
from metaid.errors import EpisodeError
from metaid.models import Array, factors_from_names
from metaid.plant import load_chain

if TYPE_CHECKING:
    from metaid.compiled import Objective

STEPS = 5000
TABLES = (1, 2)  # each of as many links as its number
FIG4_FACTOR = 1.01  # of all lumps
SMALL_PUSH = 0.01  # N s: the motion stays small, so that what gains speed past the limit falls
SWEEP = np.round(np.linspace(0.5, 1.5, 21), 2)


@dataclass(frozen=True)
class Reading:
    """How the paper's experiment may have been done: the `plant`; the `push` at its tip after which periods are counted
    by a `rule`; the `fall_push` after which falls are looked for, both in N s; and the fall rule's margin.
    """

    plant: str
    push: float
    rule: str
    fall_push: float
    fall_margin: float = FALL_MARGIN

    @cached_property
    def counting(self) -> Objective:
        """Counts over all steps, whatever falls: after a large push, what coasts or tumbles passes any limit."""
        return self.objective(self.push, fall_rule=FallRule(limit=np.inf), keep_angles=True)

    @cached_property
    def falling(self) -> Objective:
        """Tells which candidates fall."""
        return self.objective(self.fall_push, fall_rule=FallRule(margin=self.fall_margin))

    def objective(self, push: float, **options: Any) -> Objective:
        """Counts after a `push` at the tip, in N s, in factors of the plant's own lumps; `options` of the episode."""
        from metaid.compiled import Objective  # loads numba

        plant = load_chain(self.plant)
        impulses = np.eye(plant.njoint)[-1:] * push
        return Objective(plant, plant.chain.lumps, Episode(impulses, STEPS, **options), "count", rule=self.rule)

    def periods(self, factors: Array) -> list[int]:
        """Periods per joint by the reading's rule."""
        return list(self.counting.evaluate(factors).periods)

    def complete_periods(self, factors: Array) -> list[int]:
        """Whole periods per joint of the same motion."""
        counted: list[int] = whole_periods(self.counting.record(factors).half_periods).tolist()
        return counted


PURE = {
    1: Reading("paper-one-link", push=0.0593, rule="maxima", fall_push=SMALL_PUSH),
    2: Reading("paper-two-link", push=0.2015, rule="maxima", fall_push=SMALL_PUSH),
}
LIKE = {
    1: Reading("paper-like-one-link", push=0.034, rule="alternations", fall_push=0.034, fall_margin=0.0),
    2: Reading("paper-like-two-link", push=0.12, rule="alternations", fall_push=0.12, fall_margin=0.0),
}


@dataclass(frozen=True)
class PaperRow:
    """A row as printed: `factors` by lump name, and `periods` per joint in 5,000 steps, none if it fell."""

    factors: dict[str, float]
    periods: tuple[int, ...]
    falls: bool


def paper_table(number: int) -> list[PaperRow]:
    """Table I or II as the paper prints it.  Raises EpisodeError if there is no such table."""
    if number not in TABLES:
        raise EpisodeError(f"the paper has no table {number} (allowed: {', '.join(map(str, TABLES))})")
    with (Path(__file__).parent / f"table{number}.csv").open(encoding="utf-8") as lines:
        return [_paper_row(row) for row in csv.DictReader(lines)]


def _paper_row(row: dict[str, str]) -> PaperRow:
    factors, periods = {}, []
    for column, text in row.items():
        if "periods" in column:
            periods += [int(text)] if text else []
        elif column != "falls":
            factors["gravity_1" if column == "mass_factor" else column.partition("_")[2]] = float(text)
    return PaperRow(factors, tuple(periods), row["falls"] == "true")


def run_table(number: int) -> list[dict[str, Any]]:
    """The rows of Table I or II, each as `metaid paper tableN --json` prints it; a row that falls has no periods.

    `periods` and `falls` are the pure reading's, `complete_periods` the same motion counted in whole periods,
    `like_periods` and `like_falls` the fitted one's.  Raises EpisodeError if there is no such table.
    """
    rows = []
    for row in paper_table(number):
        pure, like = PURE[number], LIKE[number]
        factors = factors_from_names(row.factors, number)
        falls, like_falls = (reading.falling.evaluate(factors).fell for reading in (pure, like))
        periods = [] if falls else pure.periods(factors)
        like_periods = [] if like_falls else like.periods(factors)
        rows.append(
            {
                "factors": row.factors,
                "paper_periods": list(row.periods),
                "periods": periods,
                "paper_falls": row.falls,
                "falls": falls,
                "rule": pure.rule,
                "difference": _difference(periods, row),
                "complete_periods": [] if falls else pure.complete_periods(factors),
                "like_periods": like_periods,
                "like_falls": like_falls,
                "like_rule": like.rule,
                "like_difference": _difference(like_periods, row),
            }
        )
    return rows


def run_fig4(reading: Reading) -> tuple[Array, list[int]]:
    """Joint angles (nsteps + 1 x 2), in rad, and periods per joint, with all factors 1.01: the paper's Fig. 4."""
    factors = np.full(3, FIG4_FACTOR)
    periods = reading.periods(factors)
    (angles,) = reading.counting.record(factors).angles
    return angles.copy(), periods


def show_fig4() -> dict[str, Any]:
    """Fig. 4 in numbers, as `metaid paper fig4 --json` prints it."""
    (printed,) = (row for row in paper_table(2) if set(row.factors.values()) == {FIG4_FACTOR})
    readings = []
    for name, reading in (("pure", PURE[2]), ("paper-like, fitted", LIKE[2])):
        angles, periods = run_fig4(reading)
        largest = np.degrees(np.abs(angles).max(axis=0)).tolist()
        complete = reading.complete_periods(np.full(3, FIG4_FACTOR))
        counted = {"rule": reading.rule, "periods": periods, "complete_periods": complete}
        readings.append({"reading": name, "plant": reading.plant, **counted, "largest_degrees": largest})
    return {"factors": printed.factors, "steps": STEPS, "paper_periods": list(printed.periods), "readings": readings}


def run_sweep() -> list[dict[str, Any]]:
    """Periods of two links over the factor of the Coriolis lump (the paper's f_m1), gravity factors 1.01 as in Fig. 4.

    `periods`: whole periods of the pure plant after a small push; `frequency_hz`: per joint, the same interpolated;
    `like_periods`: the fitted reading's.
    """
    small = PURE[2].objective(SMALL_PUSH)
    rows = []
    for factor in SWEEP.tolist():
        named = {"coriolis_1_2": factor, "gravity_1": FIG4_FACTOR, "gravity_2": FIG4_FACTOR}
        factors = factors_from_names(named, 2)
        record = small.record(factors)
        rows.append(
            {
                "factors": named,
                "periods": whole_periods(record.half_periods).tolist(),
                "frequency_hz": crossing_hz(record.half_periods, record.crossing_span)[0].tolist(),
                "like_periods": LIKE[2].periods(factors),
            }
        )
    return rows


def _difference(counted: list[int], row: PaperRow) -> list[int] | None:
    return [ours - paper for ours, paper in zip(counted, row.periods, strict=True)] if counted and row.periods else None
