"""Files of arms that tests read."""

from __future__ import annotations

from pathlib import Path

from metaid.plant import ArmSettings
from metaid.plant.description import Arm, read_arm

# A turned base, a joint off its body's origin, a reference angle, two joints on one body, a slide, a fixed body, a
# gripper of two fingers, and masses that follow from shapes.
MJCF = """
<mujoco>
  <compiler angle="radian"/>
  <option gravity="0.3 -0.2 -9.7"/>
  <worldbody>
    <geom type="plane" size="2 2 0.1"/>
    <body name="base" pos="0.1 0.2 0.3" euler="0.1 0.2 0.3">
      <geom type="box" size="0.1 0.1 0.05"/>
      <body name="upper" pos="0 0 0.1" euler="0.3 0 0.1">
        <joint name="waist" axis="0 0.2 1" pos="0.02 -0.03 0.01" range="-2 1.5" limited="true" armature="0.2"/>
        <joint name="shoulder" axis="0 1 0.1" pos="0 0 0.05" ref="0.4" damping="0.3" frictionloss="0.1"/>
        <geom type="capsule" fromto="0 0 0 0.3 0 0.1" size="0.04"/>
        <body name="cover" pos="0.1 0.1 0" euler="0.4 0 0"><geom type="box" size="0.05 0.02 0.1"/></body>
        <body name="fore" pos="0.3 0 0.1" euler="0 0.5 0">
          <joint name="elbow" type="slide" axis="1 0 0.3" ref="0.1" range="-0.2 0.3" limited="true"/>
          <inertial pos="0.1 0.02 0.03" mass="1.3" fullinertia="0.02 0.03 0.025 0.002 -0.001 0.003"/>
          <body name="wrist" pos="0.2 0 0">
            <joint name="wrist" axis="1 0 0" pos="0 0.01 0"/>
            <geom type="sphere" size="0.05" pos="0.03 0 0.02"/>
            <body name="left" pos="0.1 0.02 0"><joint name="left" type="slide" axis="0 1 0"/>
              <geom type="box" size="0.02 0.01 0.01" pos="0.03 0 0"/></body>
            <body name="right" pos="0.1 -0.02 0"><joint name="right" type="slide" axis="0 1 0"/>
              <geom type="box" size="0.02 0.01 0.01" pos="0.03 0 0"/></body>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <equality><joint joint1="left" joint2="right" polycoef="0 -1 0 0 0"/></equality>
  <actuator>
    <motor joint="waist" gear="50" ctrlrange="-2 1" ctrllimited="true" armature="1e-4" damping="1e-5"/>
    <position joint="shoulder" kp="100" forcerange="-30 30" forcelimited="true"/>
  </actuator>
</mujoco>
"""


JOINTS = ("waist", "shoulder", "elbow", "wrist")


HOME = {"left": 0.01, "right": -0.013}


URDF = """
<robot name="two">
  <link name="base"><collision><geometry><mesh filename="package://nowhere/base.stl"/></geometry></collision></link>
  <link name="upper">
    <inertial><origin xyz="0.1 0 0.02" rpy="0.1 0.2 0.3"/><mass value="2"/>
      <inertia ixx="0.02" iyy="0.03" izz="0.025" ixy="0.002" ixz="-0.001" iyz="0.003"/></inertial>
    <visual><geometry><mesh filename="package://nowhere/upper.dae"/></geometry></visual>
    <collision><geometry><mesh filename="package://nowhere/upper.stl"/></geometry></collision>
  </link>
  <link name="fore">
    <inertial><origin xyz="0 0.1 0"/><mass value="1"/>
      <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <link name="tool"><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.3" rpy="0.2 0 0"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="2" effort="40" velocity="3"/><dynamics damping="0.5" friction="0.2"/>
  </joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="fore"/><origin xyz="0.3 0 0"/>
    <axis xyz="0 0 1"/></joint>
  <joint name="flange" type="fixed"><parent link="fore"/><child link="tool"/><origin xyz="0 0.2 0"/></joint>
</robot>
"""


def read(folder: Path, text: str, **entries: object) -> Arm:
    """The arm that a file with this `text` describes, read as a plant file with these `entries` has it."""
    path = folder / "arm.xml"
    path.write_text(text, encoding="utf-8")
    kind = "urdf" if "<robot" in text else "mjcf"
    return read_arm(ArmSettings.model_validate({kind: str(path), **entries}), "arm.toml")


TWO = """
<mujoco><compiler angle="radian"/><option {option}/>
  <worldbody><body>{base}<geom size="0.1"/>
    <body name="upper" {upper}><joint name="shoulder" axis="0 1 0" {joint}/><geom size="0.1" name="g"/>
    <body name="fore" pos="0.5 0 0"><joint name="elbow" axis="0 1 0"/><geom size="0.1" pos="0.2 0 0"/>{within}</body>
    {beside}</body></body></worldbody>
  {after}
</mujoco>"""


def two(**pieces: str) -> str:
    """An MJCF of two links with these pieces in it."""
    return TWO.format(**dict.fromkeys(("option", "upper", "base", "joint", "within", "beside", "after"), "") | pieces)
