"""What all trials of a study say of an arm: the arm that, simulated under the very laws that were sent, shows what was
seen.

    loop = ArmLoop(plant, nominal, episode)                      # metaid.compiled.spatial
    record = loop.run(law)                                       # law: parameters (njoint x 13)
    trial = watched_arm_trial(law, episode, record.timestep, record.windows)
    estimate = estimate_arm([trial, ...], ArmUnknowns(ArmPrior(nominal)))
    law = estimate.parameters                                    # what the next trial sends

`ArmMotions` compares windows of arms without noise; what the sensors of a noisy one read is compared as a chain's is.
An `ArmExperiment` is all of this for a study. numba is loaded when something is compared.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from metaid.estimation.spatial.unknowns import ArmEstimate, ArmUnknowns
from metaid.estimation.trials import WatchedArmTrial

if TYPE_CHECKING:
    from metaid.estimation.spatial.arm_experiment import (
        ArmExperiment,
        SeenArmTrial,
        compared_of_arm,
        estimate_arm,
        read_arm_trial,
        watched_arm_trial,
    )
    from metaid.estimation.spatial.motions import ArmMotions

__all__ = [
    "ArmEstimate",
    "ArmExperiment",
    "ArmMotions",
    "ArmUnknowns",
    "SeenArmTrial",
    "WatchedArmTrial",
    "compared_of_arm",
    "estimate_arm",
    "read_arm_trial",
    "watched_arm_trial",
]
_LOADS_NUMBA = {"ArmMotions": "motions"}
_EXPERIMENT = "ArmExperiment", "SeenArmTrial", "compared_of_arm", "estimate_arm", "read_arm_trial", "watched_arm_trial"
_LOADS_NUMBA |= dict.fromkeys(_EXPERIMENT, "arm_experiment")


def __getattr__(name: str) -> Any:
    if name in _LOADS_NUMBA:
        return getattr(import_module(f"metaid.estimation.spatial.{_LOADS_NUMBA[name]}"), name)
    raise AttributeError(f"module 'metaid.estimation.spatial' has no attribute '{name}'")
