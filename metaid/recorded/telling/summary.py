"""All that logs say as JSON: what `metaid estimate --json` prints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from metaid.frames import json_rows
from metaid.recorded.estimating import RecordedEstimate
from metaid.recorded.reading.readings import Record
from metaid.recorded.telling.curves import friction_curves
from metaid.recorded.telling.judging import RecordedVerdict
from metaid.recorded.telling.model_files import FileError

KEYS = ("name", "unit", "nominal", "value", "sd", "sd_systematic", "low", "high", "determined", "expression")


def summary(
    plant: str,
    records: Sequence[Record],
    found: RecordedEstimate,
    verdict: RecordedVerdict,
    validation: Sequence[dict[str, Any]],
    files: Sequence[FileError],
) -> dict[str, Any]:
    """What `metaid estimate --json` prints.

    Args:
        plant: the name of the nominal robot.
        records: the logs.
        found: what they say.
        verdict: on it.
        validation: what the model predicts of logs that it was not fitted to.
        files: that were written.
    """
    rows = verdict.lumps.rename(columns={"identified": "value"})
    equations, model = found.equations, found.model
    logs = zip(records, found.zeros.tolist(), strict=True)
    return {
        "name": records[0].name,
        "plant": plant,
        "verdict": verdict.word,
        "reasons": list(verdict.reasons),
        "logs": [
            {
                "path": record.name,
                "rows": len(record.times),
                "seconds": float(record.times[-1] - record.times[0]),
                "zeros": zeros,
                "repairs": [asdict(repair) for repair in record.repairs],
            }
            for record, zeros in logs
        ],
        "held_out": found.held_out.summary,
        "nominal_held_out": found.nominal_held_out.summary,
        "validation": list(validation),
        "parameters": json_rows(rows[list(KEYS)]),
        "friction": {
            "terms": list(model.terms),
            "presliding": model.sliding.presliding.tolist(),
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
            "degree": equations.parts[0].windows.degree,
            "count": equations.nwindow,
            "cutoff_hz": found.logs[0].cutoff,
            "moving_s": found.moved,
        },
        "misfit": found.misfit,
        "files": [asdict(each) for each in files],
    }
