"""The identified model in MuJoCo: the file is written, loaded, and asked for the same torques (docs/how-to.md).

python examples/into_mujoco.py
"""

import mujoco
import numpy as np

import metaid

model = metaid.estimate("double-pendulum", "double-pendulum").model
model.write("found.xml")

robot = mujoco.MjModel.from_xml_path("found.xml")
data = mujoco.MjData(robot)
data.qpos, data.qvel, data.qacc = state = np.random.default_rng(1).standard_normal((3, robot.nv))
mujoco.mj_inverse(robot, data)
wrong = np.abs(data.qfrc_inverse - model.inverse_dynamics(*state)).max()
print(f"found.xml has the torques of the model to {wrong:.0e} N m")
