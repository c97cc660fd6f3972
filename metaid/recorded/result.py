"""All of it in one call: from the files of a log and of a nominal plant to what the log says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from metaid.errors import RecordError, unknown
from metaid.plant import ArmPlant, load_plant
from metaid.recorded.estimate import Choices, RecordedEstimate, estimate_record
from metaid.recorded.judging import RecordedVerdict, judge_record, record_summary
from metaid.recorded.laws import law_torques
from metaid.recorded.linear_model import FRICTION, TERMS, LinearModel, arm_model, chain_model
from metaid.recorded.log import Record, read_record
from metaid.recorded.taking_out import recorded_identified_model
from metaid.results.exporting import IdentifiedModel


@dataclass(frozen=True)
class RecordedResult:
    """What a log says of the plant with the name `plant`: the `record` that was read, the `estimate`, the `verdict`."""

    plant: str
    record: Record
    estimate: RecordedEstimate
    verdict: RecordedVerdict

    @property
    def summary(self) -> dict[str, Any]:
        """What `metaid estimate --json` prints."""
        return record_summary(self.record, self.plant, self.estimate, self.verdict)

    @property
    def model(self) -> IdentifiedModel:
        """The identified model, to be written.  Raises RecordError where nothing was found."""
        return recorded_identified_model(self.record, self.plant, self.estimate, self.verdict)


def identify_record(
    path: Path,
    plant: str | Path,
    *,
    law: str | Path | None = None,
    friction: Sequence[str] | None = None,
    coupled: Sequence[tuple[int, int]] = (),
    choices: Choices | None = None,
) -> RecordedResult:
    """What a log says of a plant.

    Args:
        path: of the log.
        plant: the nominal plant: the name of a shipped one, or the path of a plant file, an MJCF or a URDF.
        law: the plant that the torques compensated, where the log has none.
        friction: the terms of every joint; by default those of FRICTION.
        coupled: pairs of joints, from 1 on, whose motors are coupled.
        choices: the windows and the delay, where metaid is not to choose them.

    Raises:
        RecordError: the log cannot be used, or does not fit the plant.
        PlantError: a plant cannot be used.
    """
    nominal = load_plant(plant)
    terms = tuple(FRICTION if friction is None else friction)
    for term in terms:
        if term not in TERMS:
            raise RecordError(f"friction: {unknown('term', term, TERMS)}")
    model = _model(nominal, terms, [_joints(pair, nominal.njoint) for pair in coupled])
    record = read_record(path, model.joints, model.slides, needs_torques=law is None)
    if law is not None:
        compensated = load_plant(law)
        if compensated.njoint != nominal.njoint:
            raise RecordError(
                f"law {law} is of {compensated.njoint} joints (allowed: {nominal.njoint}, as {nominal.name} has)"
            )
        record = record.with_torques(law_torques(record, compensated))
    with threadpool_limits(1):  # matrices this small are slower on several
        found = estimate_record(record, model, choices)
    return RecordedResult(nominal.name, record, found, judge_record(record, found))


def _model(nominal: Any, friction: tuple[str, ...], coupled: list[tuple[int, int]]) -> LinearModel:
    if isinstance(nominal, ArmPlant):
        return arm_model(nominal.tree, friction, tuple(coupled))
    return chain_model(nominal.chain, nominal.gravity, friction, tuple(coupled))


def _joints(pair: tuple[int, int], njoint: int) -> tuple[int, int]:
    """A pair of joints, from 0 on.  Raises RecordError where there are no such two."""
    one, other = sorted(pair)
    if not 1 <= one < other <= njoint:
        raise RecordError(f"coupled joints {pair[0]},{pair[1]} (allowed: two of 1 to {njoint})")
    return one - 1, other - 1
