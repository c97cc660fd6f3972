"""What is pushed and watched.

`Plant` is the protocol, and `Start` from where a push begins. `MujocoPlant` is a chain that MuJoCo simulates,
`FaultyPlant` the same behind the faults that a real one has, and `SocketPlant` a rig, or any other process, behind a
socket. `ArmPlant` is a serial arm in space, whose MJCF or URDF `metaid.plant.description` reads. `load_plant` reads a
plant file. MuJoCo is loaded when a simulated plant first moves.
"""

from metaid.plant.arm_plant import ArmPlant
from metaid.plant.arm_settings import ArmSettings, by_joint
from metaid.plant.faults import FaultSettings, Limit, Noise, draw, of_each, slope_weights, stream
from metaid.plant.faulty_plant import FaultyPlant
from metaid.plant.loading import (
    ARM_FILES,
    PLANT_KEYS,
    load_chain,
    load_plant,
    load_rig,
    read_any_plant,
    read_plant,
    refuse_parts_outside,
    with_joints,
)
from metaid.plant.mujoco_plant import MujocoPlant
from metaid.plant.protocol import Plant
from metaid.plant.settings import LinkSettings, PlantSettings, chain_of
from metaid.plant.simulated import SimulatedPlant
from metaid.plant.socket_plant import SocketPlant, SocketSettings
from metaid.plant.start import ArmStart, Start
from metaid.plant.unknown_faults import FAULT_UNITS, fault_names, fault_unit, true_faults
