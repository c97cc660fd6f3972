"""A plant with faults: what its sensors and drives do, in the compiled loop as in the plain one; always the same."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import Finished, random_links

from metaid.compiled import CompiledLoop, FaultyLoop, Objective, agrees_with_stepwise, fastest_step
from metaid.episode import RICH_FALL_LIMIT, Episode, FallRule, rich_pushes, run_stepwise
from metaid.errors import PlantError
from metaid.models import Array
from metaid.plant import FaultSettings, FaultyPlant, MujocoPlant, PlantSettings, Start, draw, load_plant, slope_weights
from metaid.store import Store
from metaid.study import create_study, load_study, run_study

FAULTS = {
    "none": {},
    "angle noise": {"angle_noise": 1e-3},
    "speed noise": {"speed_noise": 0.05},
    "no speed sensor": {"speed_sensor": False},
    "encoder": {"encoder_step": 2e-3},
    "slow control": {"control_every": 4},
    "delay": {"delay": 3},
    "torque limit": {"torque_limit": 0.5},
    "torque limits": {"torque_limit": (1.0, 0.5, 0.2)},
    "torque noise": {"torque_noise": 0.05},
    "push noise": {"push_noise": 0.1},
    "tilt": {"tilt": 0.03},
    "motor gains": {"torque_gain": (1.0, 1.2, 0.9)},
    "encoder offsets": {"encoder_offset": (0.02, -0.03, 0.01)},
}
ALL = {key: value for name, faults in FAULTS.items() if name != "torque limits" for key, value in faults.items()}


def faulty_plant(nlink: int = 3, **faults: object) -> MujocoPlant:
    """A random chain with these faults."""
    settings = FaultSettings.model_validate(faults)
    return MujocoPlant("faulty", PlantSettings(links=random_links(nlink, 1), faults=settings))


def episode_of(plant: MujocoPlant, count: int = 3, steps: int = 80) -> Episode:
    """Rich pushes of that plant, whose angles are kept."""
    return Episode(rich_pushes(plant, count, 3.0, seed=1), steps, FallRule(RICH_FALL_LIMIT), keep_angles=True, seed=5)


@pytest.mark.parametrize("faults", [*FAULTS.values(), ALL], ids=[*FAULTS, "all of them"])
def test_compiled_loop_is_the_plain_one(faults: dict[str, object]) -> None:
    """Readings, crossings, energies and falls are equal, near the truth and far from it."""
    plant = faulty_plant(**faults)
    near = replace(episode_of(plant), fall_rule=FallRule(0.6, 1.0))
    episode = FaultyLoop(plant, near, fastest_step(plant))
    fell = set()
    for factor in (1.0, 1.3, -5.0):
        candidate = plant.chain.lumps.scaled(np.full(6, factor))
        plain, _ = run_stepwise(episode.plant, candidate, episode.episode)
        fell.add(plain.fall_step is not None)
        compiled = episode.run(candidate)
        assert (compiled.total_steps, compiled.fall_step) == (plain.total_steps, plain.fall_step)
        assert (compiled.half_periods == plain.half_periods).all()
        for one, other in zip(compiled.angles, plain.angles, strict=True):
            assert np.allclose(one, other, rtol=0.0, atol=1e-7)
        assert compiled.crossing_span == pytest.approx(plain.crossing_span, abs=1e-6)
        assert compiled.speed_energy == pytest.approx(plain.speed_energy, rel=1e-6)
        assert compiled.acceleration_energy == pytest.approx(plain.acceleration_energy, rel=1e-6)
    assert True in fell


def test_compiled_loop_is_the_plain_one_with_friction_and_stiffness_in_the_law() -> None:
    """The whole law is sent to a faulty plant too: damping, and the springs that are asked for."""
    links = tuple(link.model_copy(update={"damping": 0.05}) for link in random_links(2, 1))
    plant = MujocoPlant("damped", PlantSettings(links=links, faults=FaultSettings(angle_noise=1e-3, delay=1)))
    candidate = plant.chain.lumps_of(plant.chain.kinds).scaled(np.full(5, 1.1))
    episode = FaultyLoop(plant, replace(episode_of(plant), stiffness=30.0), fastest_step(plant))
    compiled, (plain, _) = episode.run(candidate), run_stepwise(episode.plant, candidate, episode.episode)
    assert np.allclose(compiled.angles, plain.angles, rtol=0.0, atol=1e-9)
    assert compiled.acceleration_energy == pytest.approx(plain.acceleration_energy, rel=1e-6)


def test_plant_without_faults_keeps_its_own_loop_and_every_bit() -> None:
    """No fault is on unless it is named, and then nothing is slower or different."""
    plant, same = faulty_plant(), MujocoPlant("plain", PlantSettings(links=random_links(3, 1)))
    episode = episode_of(plant)
    objectives = [Objective(each, each.chain.lumps, episode, "spectral") for each in (plant, same)]
    assert all(type(objective._loop) is CompiledLoop for objective in objectives)
    factors = np.array([1.1, 0.9, 1.05, 1.0, 1.2, 0.8])
    ideal = objectives[0].record(factors)
    assert ideal.acceleration_energy.tobytes() == objectives[1].record(factors).acceleration_energy.tobytes()
    # The loop for faulty plants, with no fault on, sees the same.
    faulty = FaultyLoop(plant, episode, fastest_step(plant)).run(plant.chain.lumps.scaled(factors))
    assert faulty.acceleration_energy == pytest.approx(ideal.acceleration_energy, rel=1e-9)
    assert (faulty.half_periods == ideal.half_periods).all()


def test_compiled_loop_that_disagrees_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    """A wrong compiled loop is found out at start-up, said so, and the plain loop gives the right outcome."""
    plant = faulty_plant(**ALL | {"torque_limit": None})
    lumps, episode, factors = plant.chain.lumps, episode_of(plant), np.ones(6)
    right = Objective(plant, lumps, episode, "spectral").evaluate(factors)
    true_run = FaultyLoop.run
    monkeypatch.setattr(
        FaultyLoop,
        "run",
        lambda self, candidate: true_run(self, candidate.scaled(np.full(6, 1.1))),
    )
    with pytest.warns(UserWarning, match="compiled loop disagrees"):
        slow = Objective(plant, lumps, episode, "spectral")
    assert slow.evaluate(factors).value == pytest.approx(right.value, rel=1e-6)


def test_noise_depends_on_the_seed_and_the_number_of_the_trial_alone() -> None:
    """Who evaluates a trial, what came before it, and the last bits of its candidate change nothing in its noise."""
    plant, other = (faulty_plant(**ALL | {"torque_limit": None}) for _ in range(2))
    episode = episode_of(plant)
    one, two = (Objective(each, plant.chain.lumps, episode, "smoothed") for each in (plant, other))
    factors = np.array([np.full(6, factor) for factor in (1.0, 1.02, 1.0, 0.98)])
    numbers = [7, 3, 8, 5]
    batch = one.share(factors, numbers)
    one.work_on(batch)
    together = one.outcomes(batch)
    apart = [two.evaluate(row, number) for row, number in zip(factors[::-1], numbers[::-1], strict=True)]
    assert together == apart[::-1]
    assert together[0] != together[2]  # the same candidate in another trial
    readings = [objective.record(factors[0], 7).angles[0] for objective in (one, two)]
    assert (readings[0] == readings[1]).all()
    assert np.allclose(one.record(factors[0] + 1e-15, 7).angles[0], readings[0], rtol=0.0, atol=1e-9)
    assert not np.array_equal(readings[0], one.record(factors[0], 8).angles[0])
    reseeded = replace(episode, seed=6)
    reread = Objective(plant, plant.chain.lumps, reseeded, "smoothed").record(factors[0], 7).angles[0]
    assert not np.array_equal(readings[0], reread)


def test_candidate_that_is_evaluated_alone_has_the_noise_of_trial_zero() -> None:
    """As the noise of an episode outside of any study."""
    plant = faulty_plant(angle_noise=1e-3)
    objective = Objective(plant, plant.chain.lumps, episode_of(plant), "smoothed")
    assert objective.evaluate(np.ones(6)) == objective.evaluate(np.ones(6), 0)
    assert objective.evaluate(np.ones(6)) != objective.evaluate(np.ones(6), 1)


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_noisy_study_has_the_same_trials_however_it_is_run(workers: int, tmp_path: Path) -> None:
    """Workers and stops in mid-generation change nothing in the trial table."""
    changes = {"sampler": "cmaes", "trials": 40, "estimate.enabled": False}  # an estimate takes longer than the trials
    tables = []
    for name, stops in (("whole", [40]), ("stopped", [13, 27, 40])):
        store = Store(str(tmp_path / f"{name}.db"), create=True)
        create_study(store, load_study("noisy-three-link", changes), "study")
        for trials in stops:
            run_study(store, "study", trials, workers=workers if name == "stopped" else 2)
        names = [f"gravity_{i}" for i in (1, 2, 3)] + ["coriolis_1_2", "coriolis_1_3", "coriolis_2_3"]
        tables.append([(t.factors.tolist(), t.outcome) for t in store.trials("study", names)])
        store.close()
    assert len(tables[0]) == 40
    assert tables[0] == tables[1]


def _first_speeds(plant: MujocoPlant, torque: Array, steps: int) -> Array:
    """The plant's true joint speeds (nsteps x njoint) under a constant commanded torque, from rest upright."""
    faulty, speeds = FaultyPlant(plant), []
    faulty.begin(draw(plant.settings.faults, np.random.default_rng(0), 1, steps, plant.njoint))
    faulty.push(Start.upright(np.zeros(plant.njoint)))
    for _ in range(steps):
        faulty.apply_torque(torque)
        faulty.step()
        speeds.append(plant.states()[1])
    return np.array(speeds)


def test_delay_limit_and_slow_control_act_on_the_torque() -> None:
    """A torque comes `delay` control steps late, is no larger than the limit, and holds for `control_every` steps."""
    torque = np.array([3.0])
    free = _first_speeds(faulty_plant(1), torque, 6)[:, 0]
    late = _first_speeds(faulty_plant(1, delay=2), torque, 6)[:, 0]
    assert late == pytest.approx([0.0, 0.0, *free[:4]])
    limited = _first_speeds(faulty_plant(1, torque_limit=1.5), torque, 1)[0, 0]
    assert limited == pytest.approx(0.5 * free[0])
    assert _first_speeds(faulty_plant(1, control_every=3), torque, 2)[:, 0] == pytest.approx(free[[2, 5]])


def test_lead_makes_up_for_torques_that_come_late() -> None:
    """A delayed plant does not coast with exact lumps; told where the links will be by then, it does."""
    plant = faulty_plant(2, delay=3)
    exact, episode = plant.chain.lumps, replace(episode_of(plant), lead=3 * plant.timestep)
    values = [
        Objective(plant, exact, each, "spectral").evaluate(np.ones(3)).value for each in (episode_of(plant), episode)
    ]
    assert values[1] < 0.2 * values[0]
    compiled = FaultyLoop(plant, episode, fastest_step(plant))
    assert agrees_with_stepwise(compiled, exact, steps=80)
    ideal = Objective(faulty_plant(2), exact, episode, "spectral").evaluate(np.ones(3)).value
    assert ideal == pytest.approx(values[0], rel=0.2)


def test_tilted_base_pulls_the_upright_chain_over() -> None:
    """At the upright of the base the gravity lump times g sin(tilt) acts: in MuJoCo, and so in both loops."""
    plant = faulty_plant(1, tilt=0.05)
    gravity, inertia = plant.chain.lumps.gravity[0], plant.chain.inertia_lumps[0]
    fallen = _first_speeds(plant, np.zeros(1), 1)[0, 0]
    assert fallen == pytest.approx(plant.timestep * plant.gravity * np.sin(0.05) * gravity / inertia)


def test_noise_has_the_size_that_was_asked_for() -> None:
    """Standard deviations of readings, torques and pushes."""
    faults = FaultSettings(angle_noise=1e-3, speed_noise=0.02, torque_noise=0.3, push_noise=0.05)
    noise = draw(faults, np.random.default_rng(1), 50, 400, 3)
    sizes = [part.std() for part in (noise.angles, noise.speeds, noise.torques)]
    assert sizes == pytest.approx([1e-3, 0.02, 0.3], rel=0.02)
    assert noise.impulses.std() == pytest.approx(0.05, rel=0.2)
    assert FaultyPlant(faulty_plant(angle_noise=2e-3)).rest(5000, 1).std() == pytest.approx(2e-3, rel=0.02)


def test_encoder_shows_multiples_of_its_step_and_falls_are_seen_by_it() -> None:
    """What the sensors do not show has not happened: a coarse encoder sees a fall later than it is."""
    fine, coarse = faulty_plant(), faulty_plant(encoder_step=0.8)
    lumps = fine.chain.lumps.scaled(np.full(6, 0.1))
    episodes = [Episode(episode_of(fine).pushes[:1], 300, FallRule(0.5), keep_angles=True) for _ in range(2)]
    records = [
        FaultyLoop(plant, episode, fastest_step(plant)).run(lumps)
        for plant, episode in zip((fine, coarse), episodes, strict=True)
    ]
    assert np.allclose(records[1].angles[0] % 0.8, 0.0) or np.allclose(records[1].angles[0] / 0.8 % 1.0, 0.0)
    seen_fine, seen_coarse = (record.fall_step for record in records)
    assert seen_fine is not None
    assert seen_coarse is None or seen_coarse > seen_fine


def test_speeds_from_angles_are_exact_where_the_pendulum_coasts() -> None:
    """The filter is the slope of a line: no lag and no error on one, at any rate of readings."""
    for period in (0.0005, 0.002, 0.02):
        weights = slope_weights(period)
        line = 0.3 + 1.7 * period * np.arange(len(weights))
        assert weights @ line == pytest.approx(1.7)


def test_noise_about_the_upright_is_no_crossing() -> None:
    """Half periods are counted outside of what noise can do; without, noise alone would make dozens."""
    noisy, ideal = faulty_plant(1, angle_noise=1e-3), faulty_plant(1)
    lumps = ideal.chain.lumps.scaled(np.array([1.5]))
    pushes = rich_pushes(ideal, 1, 1.0, seed=1)
    for plant in (noisy, ideal):
        record = FaultyLoop(plant, Episode(pushes, 3000), fastest_step(plant)).run(lumps)
        assert (
            record.half_periods.tolist() == CompiledLoop(ideal, Episode(pushes, 3000)).run(lumps).half_periods.tolist()
        )


@pytest.mark.parametrize(
    ("table", "told"),
    [
        ("angle_noise = -0.1", "faults: angle_noise: should be greater than or equal to 0"),
        ("encoder = 0.1", "unknown key 'encoder'; did you mean 'encoder_step'?"),
        ("torque_limit = [1.0, 2.0]", "faults: torque_limit has 2 numbers (allowed: one, or 1)"),
        ("torque_gain = [1.0, 2.0]", "faults: torque_gain has 2 numbers (allowed: one, or 1)"),
        ("delay = 1.5", "faults: delay"),
        ("speed_sensor = 0", "faults: speed_sensor"),
    ],
)
def test_faults_that_cannot_be_are_refused_in_one_line(table: str, told: str, tmp_path: Path) -> None:
    """The message names the key and what is allowed."""
    path = tmp_path / "rig.toml"
    path.write_text(f"[faults]\n{table}\n[[links]]\nlength = 0.4\nmass = 1.0\n")
    with pytest.raises(PlantError) as refused:
        load_plant(path)
    assert told in str(refused.value)
    assert "\n" not in str(refused.value)


def test_plant_show_names_the_faults_that_are_on(metaid) -> None:  # type: ignore[no-untyped-def]
    """In words below the links."""
    shown: Finished = metaid("plant", "show", "noisy-three-link")
    assert "angle_noise 0.001; speed_sensor False" in " ".join(shown.out.split())
    assert "noise" not in metaid("plant", "show", "three-link").out
