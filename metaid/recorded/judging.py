"""Whether a log has told what is unknown of a plant, and which of it: the verdict, the table and the JSON."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from metaid.models import DEVIATIONS, Array
from metaid.recorded.estimate import RecordedEstimate
from metaid.recorded.linear_model import LinearModel
from metaid.recorded.log import Record
from metaid.results import missed, without_nan
from metaid.study import COARSEST

LARGEST_ERROR = 0.2  # of the held-out torque, that a model may leave which is said to be found
SCALE = (
    "every number scales with the torques of the log, and nothing in it shows a wrong scale of all of them, as of "
    "motor currents with a wrong constant"
)
LEAST_TURN, LEAST_SLIDE = 0.02, 0.002  # rad, m, from end to end: within less joints do not slide, they bend and creep
POSES = 50  # of the log, at which the mass matrix is looked at


@dataclass(frozen=True)
class RecordedVerdict:
    """The `word`, the `reasons` (sentences without a full stop), and one row an unknown in `lumps`, with the columns of
    `metaid.lumps` and, of an arm, its `expression`.
    """

    word: Literal["found", "not found"]
    reasons: tuple[str, ...]
    lumps: pd.DataFrame

    @property
    def is_found(self) -> bool:
        return self.word == "found"


def judge_record(record: Record, found: RecordedEstimate) -> RecordedVerdict:
    """The verdict on what a log says: found is what is determined, and predicts the torque of parts that were held out.

    No number is given where nothing is found.
    """
    determined = _determined(found)
    against = tuple(_against(record, found, determined))
    if against:
        return RecordedVerdict("not found", (*against, *_lacking(found)), _table(found, np.zeros_like(determined)))
    lumps = _table(found, determined)
    return RecordedVerdict(
        "found", (_explained(found), SCALE, *_lacking(found), *missed(lumps, "this log does")), lumps
    )


def _determined(found: RecordedEstimate) -> NDArray[np.bool_]:
    """Which unknowns (nparam) are known to a tenth: of what they are, or of an arm what they may have been wrong by
    beforehand.
    """
    whole = np.abs(found.values)
    if not found.model.is_chain:
        beforehand = np.sqrt(np.diag(found.model.covariance))
        whole[: found.model.nbody] = np.maximum(whole[: found.model.nbody], beforehand)
    return np.asarray(found.deviations <= COARSEST * whole, dtype=np.bool_)


def _against(record: Record, found: RecordedEstimate, determined: NDArray[np.bool_]) -> Iterator[str]:
    """What speaks against the model."""
    model = found.model
    reach = np.ptp(record.angles, axis=0) / np.where(model.slides, LEAST_SLIDE, LEAST_TURN)
    if not reach.max() >= 1.0:
        farthest = int(reach.argmax())
        unit = "m" if model.slides[farthest] else "rad"
        yield (
            f"no joint goes farther than {np.ptp(record.angles[:, farthest]):.2g} {unit} from end to end: within so "
            f"little friction holds like a spring (allowed: {LEAST_TURN:g} rad or more, {LEAST_SLIDE:g} m of a slide): "
            "move farther"
        )
        return
    if not found.error <= LARGEST_ERROR:
        worst = int(found.by_joint.argmax())
        yield (
            f"torques of parts of the log that were held out are predicted to {found.error:.3g} of what they are, "
            f"worst in joint {model.joints[worst]} (allowed: {LARGEST_ERROR:g}): look for wrong units, signs or "
            "lengths, for forces that are in no term, and for torques that are late"
        )
        return
    if not determined[: model.nbody].any():
        yield f"the log shows nothing of the bodies to better than {COARSEST:.0%}: move faster, or longer, or farther"
        return
    least = _least_inertia(record, found)
    if not least > 0.0:
        yield (
            "the mass matrix that follows is not positive definite at poses of the log: move faster, or with more "
            "joints at once, or leave out terms of friction"
        )


def _least_inertia(record: Record, found: RecordedEstimate) -> float:
    """The least eigenvalue of the mass matrix at poses of the log, scaled so that its diagonal is 1."""
    model, n = found.model, found.model.njoint
    poses = record.angles[np.linspace(0, len(record.angles) - 1, POSES).astype(np.intp)]
    where = np.repeat(poses[:, None], n + 1, axis=1)
    each = np.broadcast_to(np.vstack([np.zeros(n), np.eye(n)]), where.shape)
    torque = model.regressor(where, np.zeros_like(where), each) @ found.values
    matrices = (torque[:, 1:] - torque[:, :1]).swapaxes(-1, -2)
    diagonal = np.einsum("pii->pi", matrices)
    if (diagonal <= 0.0).any():
        return -1.0
    scale = 1.0 / np.sqrt(diagonal)
    return float(np.linalg.eigvalsh(matrices * scale[:, :, None] * scale[:, None, :]).min())


def _explained(found: RecordedEstimate) -> str:
    """How well the model predicts, and what is not explained, where."""
    worst = int(found.by_joint.argmax())
    return (
        f"torques of each third of the log are predicted from the others to {found.error:.2%} of what they are, worst "
        f"in joint {found.model.joints[worst]} ({found.by_joint[worst]:.2%}); intervals are as wide as what is left "
        "makes them"
    )


def _lacking(found: RecordedEstimate) -> Iterator[str]:
    """What the model has not, and would explain some of what is left."""
    if found.lacking:
        yield f"{', '.join(found.lacking)} would explain some of what is left, so intervals hold what it would change"


def _table(found: RecordedEstimate, determined: NDArray[np.bool_]) -> pd.DataFrame:
    model, values, deviations = found.model, found.values, found.deviations
    nominal = np.full(len(values), np.nan)
    nominal[: model.nbody] = model.nominal

    def where(column: Array) -> Array:
        return np.where(determined, column, np.nan)

    reach = DEVIATIONS * deviations
    columns: dict[str, Any] = {
        "name": model.names,
        "unit": model.units,
        "nominal": nominal,
        "factor": where(values / np.where(nominal == 0.0, np.nan, nominal)),
        "identified": where(values),
        "sd": where(deviations),
        "low": where(values - reach),
        "high": where(values + reach),
        "true": np.full(len(values), np.nan),
        "error": np.full(len(values), np.nan),
        "determined": determined,
    }
    return pd.DataFrame(columns if model.is_chain else {**columns, "expression": model.expressions})


def record_summary(record: Record, plant: str, found: RecordedEstimate, verdict: RecordedVerdict) -> dict[str, Any]:
    """What `metaid estimate --json` prints: the keys of `study show --json` that a log has, and `record`.

    Args:
        record: the log.
        plant: the name of the nominal plant.
        found: what the log says.
        verdict: on it.
    """
    model: LinearModel = found.model
    return {
        "name": record.name,
        "plant": plant,
        "verdict": verdict.word,
        "reasons": list(verdict.reasons),
        "source": "estimate",
        "misfit": None,
        "lumps": [without_nan(row) for row in verdict.lumps.to_dict("records")],
        "max_error": None,
        "model_error": None,
        "record": {
            "rows": len(record.times),
            "seconds": float(record.times[-1] - record.times[0]),
            "moving_s": found.moved,
            "window_s": found.span,
            "windows": found.windows,
            "delay_s": found.delay,
            "delay_sd_s": found.delay_deviation,
            "friction": list(model.friction),
            "coupled": [[one + 1, other + 1] for one, other in model.coupled],
            "held_out_error": found.error,
            "held_out_error_of_thirds": found.held_out.tolist(),
            "held_out_error_of_joints": dict(zip(model.joints, found.by_joint.tolist(), strict=True)),
        },
    }
