"""The logs of a real double pendulum that ship with metaid, made anew of those that its laboratory published.

    python -m benchmarks.real.shipped FOLDER

FOLDER holds a clone of `double_pendulum` of dfki-ric-underactuated-lab. Of three logs of design A.0 the first seconds
are kept: times, angles from upright, and torques that were measured. Rows that repeat a time are left out.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.real.double_pendulum import DAYS, REPOSITORY, read_log
from metaid.files import shipped_folder

RUNS = ("00", "04", "13")
SECONDS = 5.0
DECIMALS = 5  # of times in s; one less of angles, whose encoder has steps of 0.4 mrad, and of torques


def main() -> None:
    """Writes them into the checkout's `logs`."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.real.shipped", description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path, help="holds a clone of the public repository")
    design = parser.parse_args().folder / REPOSITORY / "data" / "experiment_records" / "design_A.0"
    for number, run in enumerate(RUNS, 1):
        log = read_log(design / DAYS["A.0"] / "sys_id" / f"trajectory_{run}.csv", run)
        frame = log.rows(log.times < SECONDS).frame.drop(columns=["speed_1", "speed_2"]).round(DECIMALS - 1)
        frame["time"] = log.times[: len(frame)].round(DECIMALS)
        frame.to_csv(shipped_folder("logs") / "double-pendulum" / f"run{number}.csv", index=False)


if __name__ == "__main__":
    main()
