"""A log without a flaw, and how it is read."""

from __future__ import annotations

import numpy as np
import pandas as pd

from metaid.recorded import Intake, LogRun, every_run


def clean(seconds: float = 8.0, rate: float = 200.0, seed: int = 0) -> pd.DataFrame:
    """A log of two joints that swing, speeds included, with 0.1 mrad of noise."""
    random = np.random.default_rng(seed)
    times = np.arange(round(seconds * rate)) / rate
    columns = {"time": times}
    for joint, pulse in ((1, 3.1), (2, 5.3)):
        columns[f"angle_{joint}"] = np.sin(pulse * times) + 1e-4 * random.standard_normal(len(times))
        columns[f"speed_{joint}"] = pulse * np.cos(pulse * times) + 1e-3 * random.standard_normal(len(times))
        columns[f"torque_{joint}"] = np.cos(2.0 * pulse * times) + 1e-2 * random.standard_normal(len(times))
    return pd.DataFrame(columns)


def intake(joints: tuple[str, ...] = ("1", "2"), **given: object) -> Intake:
    return Intake(joints, np.zeros(len(joints), dtype=bool), **given)  # type: ignore[arg-type]


def read(log: pd.DataFrame | str, **given: object) -> LogRun:
    """The one run in a log."""
    (record,) = every_run(intake(**given), [log])  # type: ignore[arg-type]
    return record


def kinds(record: LogRun) -> list[str]:
    return [repair.kind for repair in record.repairs]
