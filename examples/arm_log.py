"""From the log of an arm to its inverse dynamics, for a feed-forward (docs/ur5e.md); arm and log are simulated here.

python examples/arm_log.py
"""

import runpy
from pathlib import Path

import metaid

LINK = '<geom type="capsule" fromto="0 0 0 {0} 0 0" size="0.04" mass="{1}"/>'
JOINT = '<body pos="{0} 0 {1}"><joint name="{2}" axis="{3}" range="-120 120" damping="{4}"/>'
for name, masses, damping in (("arm", (3.0, 2.0), 0.5), ("nominal", (2.0, 2.6), 0.0)):
    shoulder = JOINT.format(0, 0.5, "turn", "0 0 1", damping) + LINK.format(0.3, masses[0])
    elbow = JOINT.format(0.3, 0, "lift", "0 1 0", damping) + LINK.format(0.25, masses[1])
    Path(f"{name}.xml").write_text(f"<mujoco><worldbody>{shoulder}{elbow}</body></body></worldbody></mujoco>")

simulated_log = runpy.run_path(str(Path(__file__).with_name("write_log.py")))["simulated_log"]
runs = [simulated_log("arm.xml", seconds=6.0, angle_noise=1e-4, seed=seed) for seed in (1, 2, 3)]
found = metaid.estimate(runs[:2], "nominal.xml", validate=runs[2])  # or paths, and a URDF
print(found.verdict.word, *found.verdict.reasons, sep="\n  ")
print(f"the third run, to which nothing was fitted: {found.summary['validation'][0]['torque']['relative']:.2%} off")
print(
    "torque for accelerations of 1 rad/s²:", found.model.inverse_dynamics([0.2, 0.4], [0.0, 0.0], [1.0, 1.0]).round(2)
)
