"""The logs of a real double pendulum that ship with metaid, with what its builders believed of it."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from conftest import Finished
from swinging import SAID

import metaid as package
from benchmarks.real.double_pendulum import by_mujoco, errors
from benchmarks.real.judging import Log
from metaid.files import shipped_logs

pytestmark = pytest.mark.slow

STATED = np.array([0.016, 0.035])  # rad: docs/real-plants.md of metaid's .xml for design A.0
RUNS = shipped_logs("double-pendulum")
OPTIONS = ("--friction", ",".join(SAID["friction"]), "--window", str(SAID["window"]), "--delay", str(SAID["delay"]))


def read(path: Path) -> Log:
    frame = pd.read_csv(path)
    kinds = (frame[[f"{kind}_1", f"{kind}_2"]].to_numpy() for kind in ("angle", "torque"))
    return Log(path.stem, frame["time"].to_numpy(), *kinds)


def test_model_of_two_real_runs_moves_as_the_third_in_mujoco(tmp_path: Path) -> None:
    """As well as the documents say for that machine, after 0.3 s of simulation under the torques that were measured."""
    result = package.estimate(RUNS[1:], "double-pendulum")
    written = tmp_path / "found.xml"
    result.model.write(written)
    missed = errors([read(RUNS[0])], by_mujoco(written))[0]
    assert (np.sqrt((missed**2).mean(axis=0)) <= STATED).all()


def test_name_of_shipped_logs_stands_for_all_runs(metaid: Callable[..., Finished]) -> None:
    """They are estimated with defaults alone, and predict each whole run better than the builders' bodies do."""
    told = json.loads(metaid("estimate", "double-pendulum", "--nominal", "double-pendulum", "--json").out)
    assert [log["path"] for log in told["logs"]] == ["run1.csv", "run2.csv", "run3.csv"]
    assert told["verdict"] == "approximate"
    assert told["held_out"]["by"] == "logs"
    assert told["held_out"]["torque"]["relative"] < 0.5 * told["nominal_held_out"]["torque"]["relative"]


def test_urdf_of_the_builders_predicts_as_well_as_links(metaid: Callable[..., Finished], tmp_path: Path) -> None:
    """Its inertias are twice too large, for theirs are about the joints; nothing but the nominal bodies is blamed."""
    inertial = """<inertial><origin xyz="0 0 {0}"/><mass value="{1}"/>
      <inertia ixx="{2}" iyy="{2}" izz="{2}" ixy="0" ixz="0" iyz="0"/></inertial>"""
    joint = '<joint name="{0}" type="continuous"><parent link="{1}"/><child link="{2}"/><origin xyz="0 0 {3}"/>'
    path = tmp_path / "theirs.urdf"
    path.write_text(f"""<robot name="theirs">
      <joint name="weld" type="fixed"><parent link="world"/><child link="base"/></joint><link name="base"/>
      <link name="one">{inertial.format(0.275, 0.608, 0.05472)}</link>
      <link name="two">{inertial.format(0.166, 0.63, 0.02522)}</link>
      {joint.format("shoulder", "base", "one", 0.0)}<axis xyz="0 1 0"/></joint>
      {joint.format("elbow", "one", "two", 0.3)}<axis xyz="0 1 0"/></joint></robot>""")
    by_links, by_urdf = (
        json.loads(metaid("estimate", "double-pendulum", "--nominal", nominal, *OPTIONS, "--json").out)
        for nominal in ("double-pendulum", str(path))
    )
    assert by_urdf["verdict"] == "approximate"
    assert not any("--" in reason for reason in by_urdf["reasons"])
    errors = [each["held_out"]["torque"]["relative"] for each in (by_urdf, by_links)]
    assert errors[0] < 1.1 * errors[1]


def test_command_says_what_a_file_cannot_hold_and_once_what_logs_share(metaid: Callable[..., Finished]) -> None:
    """A URDF has no rotors, which of this pendulum makes its error four times that of the MJCF. Of two logs as many
    rows are lost, and of another fewer.
    """
    given = ("double-pendulum", "--nominal", "double-pendulum", *OPTIONS)
    out = metaid("estimate", *given, "-o", "f.urdf", "-o", "f.xml").out
    lost = [line.partition(" rows lost")[0] for line in out.splitlines()[:2]]
    assert lost == ["run1.csv, run3.csv: 5", "run2.csv: 3"]
    of_urdf, lacking, of_xml = out.splitlines()[-3:]
    assert of_urdf.startswith("f.urdf: loaded again")
    assert "a URDF has no inertia of rotors; add to the mass matrix: joint_2" in lacking
    assert of_xml.startswith("f.xml: loaded again")


def test_estimate_of_logs_does_without_what_is_slow_to_load() -> None:
    """Each takes about as long as an estimate of short logs; so does the DB of studies."""
    code = (
        f"import sys, metaid; metaid.estimate({str(RUNS[0])!r}, 'double-pendulum').model; "
        "slow = 'scipy.signal', 'scipy.stats', 'numba', 'matplotlib', 'optuna', 'sqlalchemy'; "
        "print([name for name in slow if name in sys.modules])"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "[]"


@pytest.mark.parametrize("names", ["ab", "abc"])
def test_error_of_every_log_to_validate_is_printed(metaid: Callable[..., Finished], names: str) -> None:
    """As a column of the table of joints, or in a table of their own where they are many."""
    for name, run in zip(names, RUNS, strict=False):
        Path(f"{name}.csv").write_text(run.read_text())
    others = [f"{name}.csv" for name in names]
    given = (str(RUNS[0]), "--nominal", "double-pendulum", *OPTIONS)
    out = metaid("estimate", *given, "--validate", *others).out
    assert all(f"{name}.csv" in out for name in names)
    assert ("logs that nothing was fitted to" in out) == (len(names) > 2)


def test_what_follows_validate_is_fitted_to_by_nobody(metaid: Callable[..., Finished]) -> None:
    """Named together or each by itself; where no other log is left, that is said."""
    nominal, (first, *rest) = ("--nominal", "double-pendulum", *OPTIONS, "--json"), map(str, RUNS)
    together = metaid("estimate", first, "--validate", *rest, *nominal)
    assert json.loads(together.out)["logs"] == json.loads(metaid("estimate", first, *nominal).out)["logs"]
    apart = metaid("estimate", first, *nominal, *(text for each in rest for text in ("--validate", each)))
    assert json.loads(apart.out) == json.loads(together.out)
    refused = metaid("estimate", "--validate", first, *rest, *nominal)
    assert refused.status == 2
    assert "LOG" in refused.err


def test_real_run_whose_torques_are_left_out_is_no_free_pendulum(metaid: Callable[..., Finished]) -> None:
    """Its motor moves it: nothing is found, and that a motor does is named."""
    pd.read_csv(RUNS[0]).filter(regex="time|angle").to_csv("run.csv", index=False)
    refused = metaid("estimate", "run.csv", "--nominal", "double-pendulum", *OPTIONS, "-o", "run.xml")
    assert refused.status == 3
    assert "joint 2 does not move as one without a motor" in refused.out
    assert "a motor seems to move it: name the columns of torques, with --map OWN=torque" in refused.out
    assert not Path("run.xml").exists()


def test_what_is_counted_in_many_logs_is_said_once(metaid: Callable[..., Finished]) -> None:
    """Of the log that has most of it; of all with --all."""
    whole = pd.read_csv(RUNS[0])[:1200]
    for lost in range(1, 5):
        whole.drop(index=range(600, 600 + 2 * lost, 2)).to_csv(f"lost{lost}.csv", index=False)
    given = ("estimate", *(f"lost{lost}.csv" for lost in range(1, 5)), "--nominal", "double-pendulum", *OPTIONS)
    said, every = (
        [line for line in metaid(*given, *more).out.splitlines() if "lost between others" in line]
        for more in ((), ("--all",))
    )
    assert [line.partition(":")[0] for line in said] == ["lost4.csv"]
    assert said[0].endswith("; fewer in 3 more logs: --all")
    assert [line.partition(":")[0] for line in every] == [f"lost{lost}.csv" for lost in range(1, 5)]
