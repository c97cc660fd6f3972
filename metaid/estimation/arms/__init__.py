"""What all trials of a study say of an arm: the arm that, simulated under the very laws that were sent, shows what was
seen.

    loop = ArmLoop(plant, nominal, episode)                      # metaid.compiled.arms
    record = loop.run(law)                                       # law: parameters (njoint x 13)
    trial = watched_arm_trial(law, episode, record.timestep, record.windows)
    estimate = estimate_arm([trial, ...], ArmUnknowns(Belief(nominal)))
    law = estimate.parameters                                    # what the next trial sends

`ArmMotions` compares windows of arms without noise, `ArmReadings` what the sensors of a noisy one read. An
`ArmExperiment` is all of this for a study. `replay_arm` shows a trial beside its twin. numba is loaded when something
is compared.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from metaid.estimation.arms.arm_estimate import ArmEstimate
from metaid.estimation.arms.unknowns import ArmUnknowns

if TYPE_CHECKING:
    from metaid.estimation.arms.arm_experiment import ArmExperiment, SeenArmTrial, estimate_arm
    from metaid.estimation.arms.motions import ArmMotions
    from metaid.estimation.arms.readings import ArmReadings
    from metaid.estimation.arms.replaying import replay_arm
    from metaid.estimation.arms.trials import ArmReadTrial, WatchedArmTrial, read_arm_trial, watched_arm_trial

__all__ = [
    "ArmEstimate",
    "ArmExperiment",
    "ArmMotions",
    "ArmReadTrial",
    "ArmReadings",
    "ArmUnknowns",
    "SeenArmTrial",
    "WatchedArmTrial",
    "estimate_arm",
    "read_arm_trial",
    "replay_arm",
    "watched_arm_trial",
]
_LOADS_NUMBA = {"ArmMotions": "motions", "ArmReadings": "readings", "replay_arm": "replaying"}
_LOADS_NUMBA |= dict.fromkeys(("ArmExperiment", "SeenArmTrial", "estimate_arm"), "arm_experiment")
_LOADS_NUMBA |= dict.fromkeys(("ArmReadTrial", "WatchedArmTrial", "read_arm_trial", "watched_arm_trial"), "trials")


def __getattr__(name: str) -> Any:
    if name in _LOADS_NUMBA:
        return getattr(import_module(f"metaid.estimation.arms.{_LOADS_NUMBA[name]}"), name)
    raise AttributeError(f"module 'metaid.estimation.arms' has no attribute '{name}'")
