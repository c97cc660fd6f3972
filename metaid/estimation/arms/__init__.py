"""What all trials of a study say of an arm: the arm that, simulated under the very laws that were sent, shows what was
seen.

    loop = ArmLoop(plant, nominal, episode)                      # metaid.compiled.arms
    record = loop.run(law)                                       # law: parameters (njoint x 13)
    trial = watched_arm_trial(law, episode, record.timestep, record.windows)
    estimate = estimate_arm([trial, ...], ArmUnknowns(Belief(nominal)))
    law = estimate.parameters                                    # what the next trial sends

`ArmMotions` compares windows of arms without noise, `ArmReadings` what the sensors of a noisy one read. An
`ArmExperiment` is all of this for a study. `replay_arm` shows a trial beside its twin.
"""

from metaid.estimation.arms.arm_estimate import ArmEstimate, estimate_arm
from metaid.estimation.arms.arm_experiment import ArmExperiment, SeenArmTrial
from metaid.estimation.arms.motions import ArmMotions
from metaid.estimation.arms.readings import ArmReadings
from metaid.estimation.arms.replaying import replay_arm
from metaid.estimation.arms.trials import ArmReadTrial, WatchedArmTrial, read_arm_trial, watched_arm_trial
from metaid.estimation.arms.unknowns import ArmUnknowns

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
