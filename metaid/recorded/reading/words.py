"""The words that people have for what a log holds, and how the name of a column is taken apart into words."""

from __future__ import annotations

import re

from metaid.recorded.reading.units import TOKENS, spaced

VOLTAGES, INPUTS = ("voltage", "voltages"), ("u", "input", "inputs", "ctrl", "pwm", "duty")
WORDS = {
    "angle": ("angle", "angles", "position", "positions", "pos", "posa", "q", "theta", "th", "phi", "alpha", "qpos"),
    "speed": (
        *("speed", "speeds", "velocity", "velocities", "vel", "vela", "v"),
        *("dq", "qd", "qdot", "dtheta", "omega", "qvel"),
    ),
    "torque": ("torque", "torques", "effort", "efforts", "eff", "tau", "trq", "moment", "force", "forces"),
    "current": ("current", "currents", "cur", "curr", *VOLTAGES, *INPUTS),
}
ALSO_ACCELERATIONS = {"alpha"}  # angles where nothing else is
KIND_OF = {word: kind for kind, words in WORDS.items() for word in words}
LAST_NUMBER = re.compile(r"\d+(?!.*\d)")  # of a column of a numbered joint: the joint's
CHANGES = ("dot", "d", "der", "deriv", "derivative")  # beside the word of an angle: its speed
OTHERS = {"acc", "acceleration", "accelerations", "ddq", "qdd", "temperature", "temp", "error", "err", "dot"}
WISHED = {
    *("des", "desired", "ref", "reference", "target", "cmd", "command", "commanded", "set", "setpoint", "goal"),
    *("computed", "cmptd", "calculated", "calc", "model"),
}
PLAIN = {
    *("joint", "joints", "state", "states", "j", "jnt", "field", "data", "value", "msg", "link", "motor", "axis"),
    *("obs", "observation", "observations"),
    *("robot", "arm", "actual", "act", "meas", "measured", "msr", "fb", "feedback", "read", "raw"),
    *("wrapped", "unwrapped", "txt", "sec", *TOKENS),
}


def tokens_of(name: str) -> list[str]:
    """The words and numbers in a column's name, units in brackets left out."""
    return re.findall(r"[a-zµ]+|\d+", spaced(re.sub(r"[\[(].*?[^0-9].*?[\])]", " ", name)))
