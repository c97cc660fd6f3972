"""From logs to a model: three runs of a real double pendulum, which ship with metaid (docs/log.md).

python examples/log.py
"""

import metaid

# Yours are paths, or pandas frames: metaid.estimate(["run1.csv", "run2.csv", "run3.csv"], "robot.urdf")
found = metaid.estimate("double-pendulum", "double-pendulum")

print(found.verdict.word, *found.verdict.reasons, sep="\n  ")
print(found.verdict.lumps[["name", "nominal", "identified", "sd", "sd_systematic", "unit"]].round(4))

held_out, nominal = found.summary["held_out"]["torque"], found.summary["nominal_held_out"]["torque"]
print(f"Torques of runs that were left out: {held_out['relative']:.1%} off; nominal bodies {nominal['relative']:.1%}.")

found.model.write("found.xml")
print(f"found.xml, loaded by MuJoCo, is {found.error_of('found.xml').relative:.1%} off.")
