"""A test bench that shares no code with metaid but the wire protocol: what the estimate of a rig is measured on.

A serial arm of hinges, of which a planar chain is one, by Kane's equations in space, moved by Runge-Kutta steps at
20 kHz. `Imperfections` are what real benches have, each by a number. `python -m soak.bench PLANT --set delay=0.003`
listens at a socket as `examples/socket_rig.py` does, whose ticks and watchdog it uses. Nothing here imports metaid, so
that nothing of the estimate's own can agree with itself.
"""

from soak.bench.arm import Arm, arm_of_links, arm_of_mjcf
from soak.bench.body import Bench
from soak.bench.imperfections import Imperfections
