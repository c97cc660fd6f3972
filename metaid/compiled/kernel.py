"""The episode as one compiled function that releases the GIL and allocates nothing.

It does what `run_stepwise` does, at the speed of its step: MuJoCo's own `mj_step`, or the same from MuJoCo's stages.
"""

from __future__ import annotations

import numpy as np

from metaid.compiled.decorator import compiled
from metaid.compiled.law import compensate, has_fallen
from metaid.compiled.queue import take
from metaid.compiled.stages import advance, forget, look


@compiled
def _run_push(chain, start, law, settings, links, outputs, windows, kept):  # type: ignore[no-untyped-def]
    """One push of an episode, right after which the joints have the angles and speeds `start` (2 x njoint): steps run,
    and whether a link fell.

    Fills the four (njoint) `outputs`, the two `windows`, and `kept` (nsteps + 1 x njoint) with joint angles unless it
    is empty. `links` (njoint) are working space; nothing is allocated here.
    """
    timestep, steps, limit, margin, largest_turn, runaway, ends = settings
    motion, window_half_periods = windows
    half_periods, span, speed_energy, acceleration_energy = outputs
    qpos, qvel, torque = chain.qpos, chain.qvel, chain.torque
    n = start.shape[1]
    stiffness = law[-1]
    pushed, angle, speed, ran, fallen = 0.0, 0.0, 0.0, 0, False
    keep = kept.size > 0
    window = 0
    forget(chain)
    for i in range(n):
        qpos[i], qvel[i] = start[0, i], start[1, i]
        half_periods[i], span[i] = 0, 0.0
        angle += start[0, i]
        speed += start[1, i]
        pushed = max(pushed, abs(speed))
        _set_off(links[i], angle, speed, start[0, i], start[1, i])
        if keep:
            kept[0, i] = start[0, i]
    fastest, turn = margin * pushed, largest_turn
    if runaway * pushed * timestep < turn:
        turn = runaway * pushed * timestep  # Eq. 9
    # A loop of its own for each window: a comparison in every step for its end costs some 2 % at three links.
    while ran < steps and not fallen:
        end = ends[window] if window < ends.shape[0] else steps
        for step in range(ran + 1, end + 1):
            look(chain, links, stiffness)
            compensate(law, links, qvel, torque)
            advance(chain)
            angle, speed = 0.0, 0.0
            for i in range(n):
                link = links[i]
                q, v, q0, v0 = qpos[i], qvel[i], link.previous_angle, link.previous_speed
                angle += q
                speed += v
                link.angle = angle
                link.speed = speed
                link.squares += v0 * v0 + v * v
                jump = v - v0 + timestep * stiffness * q0  # Eq. 14: what the step did beyond q̈ = −k q
                link.jumps += jump * jump
                if q * link.side < 0.0:
                    time = timestep * (step - q / (q - q0))
                    if link.first < 0.0:
                        link.first = time
                    else:
                        half_periods[i] += 1
                        span[i] = time - link.first
                    link.side = -link.side
                elif link.side == 0.0:
                    link.side = np.sign(q)
                link.previous_angle = q
                link.previous_speed = v
                if has_fallen(angle, speed, fastest, timestep, limit, turn):
                    fallen = True
            if keep:
                for i in range(n):
                    kept[step, i] = qpos[i]
            ran = step
            if fallen:
                break
        if window < ends.shape[0] and not fallen:
            _keep_window(qpos, qvel, links, half_periods, timestep, motion[window], window_half_periods[window])
            window += 1
    for i in range(n):
        speed_energy[i] = 0.5 * timestep * links[i].squares
        acceleration_energy[i] = links[i].jumps / timestep
    return ran, fallen


@compiled
def _keep_window(qpos, qvel, links, half_periods, timestep, motion, counted):  # type: ignore[no-untyped-def]
    """Fills in the `motion` (4 x njoint) and the half periods `counted` (njoint) up to the end of a window."""
    for i in range(links.shape[0]):
        motion[0, i] = qpos[i]
        motion[1, i] = qvel[i]
        motion[2, i] = 0.5 * timestep * links[i].squares
        motion[3, i] = links[i].jumps / timestep
        counted[i] = half_periods[i]


@compiled
def _set_off(link, angle, speed, joint_angle, joint_speed):  # type: ignore[no-untyped-def]
    """A `link` right after a push, at its absolute `angle` and `speed` and its joint's, in rad and rad/s."""
    link.angle = angle
    link.speed = speed
    link.previous_angle = joint_angle
    link.previous_speed = joint_speed
    link.side = np.sign(joint_angle if joint_angle != 0.0 else joint_speed)
    link.first = 0.0 if joint_angle == 0.0 and joint_speed != 0.0 else -1.0
    link.squares = 0.0
    link.jumps = 0.0


@compiled
def run_from(chain, start, queue, laws, settings, links, ran, fell, outputs, windows, kept):  # type: ignore[no-untyped-def]
    """Takes pushes of a `Batch` from its queue until there are none left.

    Pushes of a candidate that is known to have fallen after an earlier one are left out.

    Args:
        chain: the `Step` that moves the plant.
        start: joint angles and speeds (npush x 2 x njoint) right after each push, in rad and rad/s.
        queue: of the batch: the number of the next push, candidate by candidate.
        laws: of the candidates; see `batch.Laws`.
        settings: timestep in s; steps after a push; the clauses of the fall rule (limit in rad, margin, largest turn in
            rad, multiple at which a link runs away); the steps (nwindow) that the windows end with.
        links: working space (njoint) of the type `LINK`.
        ran: steps after each push (ncandidate x npush), filled in.
        fell: whether each push ended in a fall (ncandidate x npush), filled in.
        outputs: half periods, crossing span, speed energy and acceleration energy of a Record (ncandidate x npush x
            njoint), filled in.
        windows: motion (ncandidate x npush x nwindow x 4 x njoint) and half periods (ncandidate x npush x nwindow x
            njoint), filled in.
        kept: joint angles (ncandidate x npush x nsteps + 1 x njoint), in rad, filled in unless it is empty.
    """
    gravity, coriolis, damping, coulomb, inertia, springs = laws
    half_periods, span, speed_energy, acceleration_energy = outputs
    motion, window_half_periods = windows
    npush = start.shape[0]
    turn = take(queue)
    while turn < gravity.shape[0] * npush:
        candidate, push = turn // npush, turn % npush
        fallen = False
        for earlier in range(push):
            fallen = fallen or fell[candidate, earlier]
        if not fallen:
            seen = (
                half_periods[candidate, push],
                span[candidate, push],
                speed_energy[candidate, push],
                acceleration_energy[candidate, push],
            )
            angles = kept[candidate, push] if kept.size > 0 else kept[:, :, 0, 0]
            friction = damping[candidate], coulomb[candidate]
            law = gravity[candidate], coriolis[candidate], *friction, inertia[candidate], springs[push]
            shown = motion[candidate, push], window_half_periods[candidate, push]
            result = _run_push(chain, start[push], law, settings, links, seen, shown, angles)
            ran[candidate, push], fell[candidate, push] = result
        turn = take(queue)
