"""What logs say of a robot: the verdict, the JSON that `metaid estimate` prints, the model, and what was left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

import metaid
from metaid.errors import first_of
from metaid.exporting import IdentifiedModel, file_torques
from metaid.frames import json_rows
from metaid.models import Array
from metaid.recorded.doubts.conventions import Fact
from metaid.recorded.estimating import RecordedEstimate
from metaid.recorded.held_out import HeldOut
from metaid.recorded.reading.readings import LogRun
from metaid.recorded.telling.curves import friction_curves
from metaid.recorded.telling.judging import RecordedVerdict
from metaid.recorded.telling.model_files import dynamics_of
from metaid.recorded.weak_form.smoothed import Smoothed

KEYS = ("name", "unit", "nominal", "value", "sd", "sd_systematic", "low", "high", "determined", "expression")


@dataclass(frozen=True)
class LeftOut:
    """One log, or a third of it, that was predicted from the others: times in s (nrow), and torques that were
    `measured` and `predicted` (nrow x njoint), in N m or N, through the filter, in a joint without a motor less what
    gravity asks for; `judged` are the rows that count.
    """

    log: str
    times: Array
    measured: Array
    predicted: Array
    judged: NDArray[np.bool_]


@dataclass(frozen=True)
class FileError:
    """How well a written file predicts: the error of its torques as a share of what they are (`relative`), of each
    joint (`by_joint`), on how many `rows`; None where it predicts none, and `why_not`.
    """

    path: str
    relative: float | None
    by_joint: tuple[float, ...]
    rows: int
    why_not: str = ""


@dataclass(frozen=True)
class RecordedResult:
    """What logs say of a robot.

    Attributes:
        plant: the name of the nominal robot.
        estimate: what they say.
        verdict: on it.
        facts: what looks wrong in the logs, with the option that mends each.
        validation: logs that nothing was fitted to, with how well they are predicted.
        nominal_repairs: what the nominal robot's file says and cannot be, as sentences.
    """

    plant: str
    estimate: RecordedEstimate
    verdict: RecordedVerdict
    facts: tuple[Fact, ...]
    validation: tuple[tuple[Smoothed, HeldOut], ...]
    nominal_repairs: tuple[str, ...] = ()

    def __repr__(self) -> str:
        predicted = 100.0 * self.estimate.held_out.relative
        return f"<RecordedResult of {self.plant}: {self.verdict.word}, torques left out predicted to {predicted:.3g} %>"

    @property
    def records(self) -> tuple[LogRun, ...]:
        """The logs as they were read."""
        return self.estimate.records

    @property
    def name(self) -> str:
        """Of the model: the first log, and how many more there are."""
        return first_of([record.name for record in self.records], 1)

    @property
    def summary(self) -> dict[str, Any]:
        """What `metaid estimate --json` prints, of files that were not written."""
        return self.summary_with(())

    def summary_with(self, files: Sequence[FileError]) -> dict[str, Any]:
        """The same with files that were written."""
        found, rows = self.estimate, self.verdict.lumps.rename(columns={"identified": "value"})
        equations, model = found.equations, found.model
        return {
            "name": self.records[0].name,
            "plant": self.plant,
            "verdict": self.verdict.word,
            "reasons": list(self.verdict.reasons),
            "logs": [
                {
                    "path": record.name,
                    "rows": len(record.times),
                    "seconds": float(record.times[-1] - record.times[0]),
                    "zeros": zeros,
                    "repairs": [asdict(repair) for repair in dict.fromkeys(record.repairs)],
                }
                for record, zeros in zip(self.records, found.zeros.tolist(), strict=True)
            ],
            "held_out": found.held_out.summary,
            "nominal_held_out": found.nominal_held_out.summary,
            "validation": [
                {"path": own.record.name, **{key: held.summary[key] for key in ("torque", "motion")}}
                for own, held in self.validation
            ],
            "parameters": json_rows(rows[list(KEYS)]),
            "friction": {
                "terms": list(model.terms),
                "presliding": model.sliding.presliding.tolist(),
                "bent": model.sliding.bent.tolist(),
                "coupled": [[one + 1, other + 1] for one, other in model.sliding.coupled],
                "taken_up": [{"what": what, "error": change} for what, change in found.chosen.tried],
                "curve": [
                    {
                        "joint": curve.joint,
                        "speed": curve.speed.tolist(),
                        "torque": curve.torque.tolist(),
                        "sd": curve.sd.tolist(),
                    }
                    for curve, is_unknown in zip(friction_curves(found), model.untrusted, strict=True)
                    if not is_unknown
                ],
            },
            "delay": found.delay,
            "delay_at_bound": found.chosen.delay_at_bound,
            "gains": None if found.gains is None else json_rows(found.gains.frame),
            "scale": found.scale,
            "window": {
                "seconds": equations.span,
                "degree": equations.finest.degree,
                "count": equations.nwindow,
                "cutoff_hz": found.logs[0].cutoff,
                "moving_s": found.moved,
            },
            "misfit": found.misfit,
            "files": [asdict(each) for each in files],
            "nominal_repairs": list(self.nominal_repairs),
        }

    @property
    def model(self) -> IdentifiedModel:
        """The identified model, to be written: the law has the whole posterior mean, and bodies for simulators the one
        with viscous and Coulomb friction and springs alone.
        """
        found, records, table = self.estimate, self.records, self.verdict.lumps
        gravity = tuple(found.model.tree.gravity.tolist())
        names = table["name"].tolist()
        about = {
            "plant": self.plant,
            "rows": sum(len(record.times) for record in records),
            "logs": [record.name for record in records],
            "verdict": self.verdict.word,
            "reasons": list(self.verdict.reasons),
            "source": "estimate",
            "misfit": None,
            "delay_s": found.delay,
            "zeros": found.zeros.tolist(),
            "held_out_error": found.held_out.relative,
            "written": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
            "metaid": metaid.__version__,
        }
        if found.gains is not None:
            about |= {"gains": found.gains.values.tolist(), "gain_deviations": found.gains.frame["sd"].tolist()}
        return IdentifiedModel(
            name=self.name,
            about=about,
            lumps=table.assign(value=table["identified"]),
            covariance=pd.DataFrame(found.covariance, index=names, columns=names),
            dynamics=dynamics_of(found),
            gravity=-gravity[2] if found.model.is_chain else gravity,
            timestep=min(0.002, min(record.period for record in records)),
        )

    @property
    def left_out(self) -> list[LeftOut]:
        """All logs, or their thirds, each predicted by what the others say, and logs that nothing was fitted to."""
        found = self.estimate
        held_out = [(found.logs, found.held_out), *(((own,), held) for own, held in self.validation)]
        model, parts = found.model, []
        for logs, held in held_out:
            for part in held.parts:
                own = logs[part.log]
                sent, predicted = own.acting(found.delay), own.predicted(model, part.values, part.zeros)
                if model.passive.any():
                    still = np.zeros_like(own.speeds)
                    weight = model.rigid(part.values[: model.nbody], own.coordinates + part.zeros, still, still)
                    weight = np.where(model.passive, own.filtered(weight), 0.0)
                    sent, predicted = sent - weight, predicted - weight
                parts.append(LeftOut(own.record.name, own.times, sent, predicted, part.rows))
        return parts

    def error_of(self, path: str | Path) -> FileError:
        """How well a file that was written predicts, loaded again, the torques of the rows that are judged (Eq. 73): of
        logs that nothing was fitted to where there are any, else of the logs themselves.
        """
        path, found = Path(path), self.estimate
        model, tree = found.model, found.possible.tree
        logs, zeros = found.logs, list(found.zeros)
        if self.validation:
            logs = tuple(own for own, _ in self.validation)
            zeros = [held.parts[0].zeros for _, held in self.validation]
        squares, whole, rows = np.zeros(model.njoint), np.zeros(model.njoint), 0
        bodies = found.values[: model.nbody]
        for own, zero in zip(logs, zeros, strict=True):
            motion = own.coordinates + zero, own.speeds, own.accelerations
            predicted = file_torques(path, self.name, *motion, tree.names, gravity=tree.gravity)
            if predicted.torques is None:
                return FileError(str(path), None, (), 0, predicted.why_not)
            sent = own.acting(found.delay)
            missed = own.squares(model, bodies, sent, sent - own.filtered(predicted.torques), own.judged)
            squares, whole, rows = squares + missed[0], whole + missed[1], rows + int(own.judged.sum())
        relative = float(np.sqrt(squares.sum() / max(whole.sum(), 1e-300)))
        by_joint = np.sqrt(squares / np.maximum(whole, 1e-300))
        return FileError(str(path), relative, tuple(by_joint.tolist()), rows)
