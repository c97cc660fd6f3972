"""metaid on an arm, for so many seconds of motion: pushes under the law of a candidate, without a sensor of torques."""

from __future__ import annotations

import numpy as np

from benchmarks.arm_rigs import HORIZON, STIFFNESS, WINDOWS, estimate_arm, read_trial
from benchmarks.rivals.conditions import Condition
from benchmarks.rivals.judging import Found
from benchmarks.rivals.pushed import trials_of
from metaid.compiled import fastest_loop
from metaid.compiled.spatial import commanded_arm_torques
from metaid.episode import arm_episode, window_ends
from metaid.estimation import ArmEstimate, ArmLaws, BaseUnknowns, Loop, ReadTrial, WatchedTrial
from metaid.models.tree import ArmPrior
from metaid.plant import ArmPlant, FaultSettings, slope_weights
from metaid.plant.description import draw_starts

LEAST_NOISE = 1e-15  # rad: readings of a rig with exact sensors are kept, too


def output_error_of_arm(plant: ArmPlant, prior: ArmPrior, condition: Condition, seconds: float, seed: int) -> Found:
    """What metaid's estimate is of all pushes, and whether it says that it has found it.

    Args:
        plant: without faults.
        prior: what is believed of it.
        condition: what is wrong with it.
        seconds: of motion.
        seed: of the starts and of the noise.
    """
    n, timestep, noise = plant.njoint, plant.timestep, condition.settings.angle_noise
    faults = FaultSettings(angle_noise=noise or LEAST_NOISE, speed_sensor=condition.settings.speed_sensor)
    rig = ArmPlant(plant.name, plant.settings.model_copy(update={"faults": faults}))
    steps = round(HORIZON / timestep)
    pushes = max(round(seconds / timestep) // steps, 1)
    trials = trials_of(pushes, n)
    count = pushes // trials
    stiffness = np.where(np.arange(count) % 3 < 2, 0.0, STIFFNESS)  # one on springs for two that coast
    starts = draw_starts(plant, count, HORIZON, seed)
    kept = {"window_ends": window_ends(steps, WINDOWS), "readings_steps": steps}
    episode = arm_episode(prior.nominal, starts, stiffness, steps, seed=seed, **kept)
    searched, law = BaseUnknowns(prior), prior.nominal.parameters
    loop = fastest_loop(rig, episode, law)
    estimate: ArmEstimate | None = None
    watched: list[WatchedTrial | ReadTrial] = []
    torque, reach = 0.0, 0.0
    for number in range(trials):
        record = loop.run(law, number)
        read = record.readings
        assert read is not None
        if noise:
            sensed = Loop(timestep, np.full(n, noise), slope_weights(timestep))
            trial = read_trial(ArmLaws(searched, episode), law, sensed, read)
            watched.append(trial)
            torques = trial.torques
        else:
            assert read.speeds is not None
            assert record.windows is not None
            watched.append(WatchedTrial(law, timestep, episode.states, record.windows, episode.springs))
            torques = commanded_arm_torques(searched.frames, law, episode, read.angles, read.speeds)
        seen = np.arange(steps + 1) < read.counts[:, None]
        torque = max(torque, float(np.abs(torques[seen[:, :-1]]).max()))
        reach = max(reach, float(np.ptp(read.angles[seen], axis=0).max()))
        estimate = estimate_arm(watched, searched, estimate)
        if estimate is None:
            break
        law = estimate.parameters
    spent = float(trials * count * HORIZON), torque, reach
    if estimate is None:
        return Found(prior.values, *spent, "not found")
    return Found(estimate.values, *spent, "found" if estimate.is_explained else "not found")
