"""Real machines: what metaid's files predict of public logs, beside published models and tuned least squares.

    python -m benchmarks.real FOLDER [--machine NAME ...] [--json]

FOLDER holds clones of any of these public repositories: `double_pendulum` and `torque_limited_simple_pendulum` of
dfki-ric-underactuated-lab (BSD-3), `dynamic_calibration` of shamilmamedov, `figaroh-examples` of thanhndv212,
`Robot_Identification` of JonasWeigand (MIT), `inverse-dynamics-solver` of unisa-acg (BSD-3), `FloBaRoID` of kjyv
(LGPL-3), `mujoco-sysid` of lvjonok (at b30002b), `FurutaPendulumRL` of EmanuelSamir, `robot_identification` of
Naruton94, `Dynamic_Parameter_Identification_for_Rokae_xMate` of YanjunLIU-ac, `Dynamics_identification_Frank` of
FrankJIE09, `xMate7p_dyn_ident` of NKU-ZiXuan, `MultiArm-Pendulum` of dynamicslab (MIT), `dynamic-identification` of
wissem01chiha (MIT, at 44f47d5), `dyn_ident_dualArmV2` of hujinfei1994, `gym-unbalanced-disk` of GerbenBeintema,
`pendubot_controller` of Capitan-Uncino.
Nothing of them ships with metaid.

The logs are turned into CSV as a user would, metaid has its defaults, and the files that it writes are measured by code
that shares nothing with it. The last lines say whether what issue 28 asks for holds.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path

from threadpoolctl import threadpool_limits

from benchmarks.common import table
from benchmarks.real import (
    ar5,
    belt,
    disk,
    double_pendulum,
    dual_arm,
    free_swing,
    gen3,
    kr300,
    lwr4,
    pendubot,
    rokae,
    rotary,
    shanghai,
    simple_pendulum,
    tx40,
    ur10,
    ur10e,
    xmate7,
)
from benchmarks.real.lines import Line, Table

Measure = Callable[[Path, Path], Iterator[Table | Line]]
MACHINES: dict[str, tuple[str, Measure]] = {
    each.__name__.rpartition(".")[2]: (each.REPOSITORY, each.measure)
    for each in (
        double_pendulum,
        simple_pendulum,
        free_swing,
        disk,
        rotary,
        pendubot,
        ur10e,
        ur10,
        tx40,
        kr300,
        shanghai,
        rokae,
        xmate7,
        ar5,
        lwr4,
        gen3,
        dual_arm,
        belt,
    )
}


def main() -> None:
    """Every machine whose repository is there."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.real", description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path, help="holds clones of the public repositories")
    parser.add_argument("--machine", action="append", choices=MACHINES, help="by default all that are there")
    parser.add_argument("--json", action="store_true", help="print JSON")
    given = parser.parse_args()
    there = [name for name in given.machine or MACHINES if (given.folder / MACHINES[name][0]).is_dir()]
    if not there:
        names = ", ".join(sorted({repository for repository, _ in MACHINES.values()}))
        parser.error(f"{given.folder} has none of the repositories (allowed: {names})")
    found: list[Table | Line] = []
    for name in there:
        repository, measure = MACHINES[name]
        begun = time.perf_counter()
        with threadpool_limits(1), tempfile.TemporaryDirectory() as place:
            for each in measure(given.folder / repository, Path(place)):
                found.append(each)
                if isinstance(each, Table) and not given.json:
                    print(f"\n{each.title}\n\n{table(each.rows)}", flush=True)
        if not given.json:
            print(f"\n{name}: {time.perf_counter() - begun:.0f} s", flush=True)
    lines = [each for each in found if isinstance(each, Line)]
    if given.json:
        tables = {each.title: each.rows for each in found if isinstance(each, Table)}
        print(
            json.dumps({"tables": tables, "lines": [asdict(each) | {"holds": each.holds} for each in lines]}, indent=2)
        )
    else:
        print("\n" + "\n".join(each.text for each in lines))


if __name__ == "__main__":
    main()
