"""A rig that is pushed, in another process behind a socket (docs/your-rig.md): here examples/socket_rig.py, simulated.

python examples/rig.py
"""

import subprocess
import sys
from pathlib import Path

import metaid

PLANT = 'socket = "unix:rig.sock"\njoints = 2\n'
NOMINAL = "".join(f"[[nominal.links]]\nlength = {length}\nmass = {mass}\n" for length, mass in ((0.42, 0.9), (0.35, 1)))
TRUE = "[[links]]\nlength = 0.42\nmass = 1.1\ncom = 0.19\n[[links]]\nlength = 0.35\nmass = 0.8\ncom = 0.2\n"
for name, text in (("rig", PLANT), ("find", f'plant = "rig.toml"\ntrials = 3\n{NOMINAL}'), ("true", TRUE)):
    Path(f"{name}.toml").write_text(text)

script = Path(__file__).with_name("socket_rig.py")
command = [sys.executable, str(script), "true.toml", "--listen", "unix:rig.sock", "--watchdog", "10"]
with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as rig:
    print(rig.stdout.readline(), end="")
    print(metaid.run("find.toml")[["name", "nominal", "identified", "low", "high", "unit"]].round(5))
    rig.terminate()
