"""A plant behind a socket: the example of docs/your-rig.md, as a process of its own, with things going wrong."""

from __future__ import annotations

import json
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import optuna
import pytest
from conftest import Finished

import metaid
from metaid.episode import Episode, pushed_speeds, rich_pushes, run_plain
from metaid.errors import AbsentPlant, LostPlant, PlantError, StudyError
from metaid.objective import Objective
from metaid.problem import Problem, load_study
from metaid.socket_plant import SocketPlant, SocketSettings

ROOT = Path(__file__).parent.parent
TWO_LINK = ROOT / "plants" / "two-link.toml"


class Server(NamedTuple):
    """A running example: where it listens, and what it has printed so far."""

    address: str
    process: subprocess.Popen[bytes]
    log: Path

    @property
    def stops(self) -> list[str]:
        """Why it took its torque off, each time."""
        return re.findall(r"torque off at tick \d+: (.*)", self.log.read_text())


Serve = Callable[..., Server]


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Serve]:
    """Starts the example rig with more arguments; ends it afterwards."""
    started: list[Server] = []

    def start(*arguments: str, plant: Path = TWO_LINK, listen: str = "tcp://127.0.0.1:0") -> Server:
        log = tmp_path / f"rig-{len(started)}.log"
        program = [sys.executable, str(ROOT / "examples" / "socket_rig.py"), str(plant), "--listen", listen]
        with log.open("wb") as output:
            process = subprocess.Popen([*program, *arguments], stdout=output, stderr=output)
        started.append(Server("", process, log))
        until = time.monotonic() + 400.0
        while "listening at" not in log.read_text():
            assert process.poll() is None, log.read_text()
            assert time.monotonic() < until
            time.sleep(0.02)
        return Server(log.read_text().split()[2], process, log)

    yield start
    for server in started:
        server.process.send_signal(signal.SIGCONT)
        server.process.kill()
        server.process.wait()


def rig_at(server: Server | str, **changes: Any) -> SocketPlant:
    """The plant that listens there; patient, since the machine may be busy."""
    address = server if isinstance(server, str) else server.address
    settings = {"joints": 2, "timestep": 0.002, "step_timeout": 60.0, **changes}
    return SocketPlant("rig", SocketSettings(socket=address, **settings))


def rig_files(folder: Path, server: Server, trials: int = 40, more: str = "") -> Path:
    """A plant file for the rig, and a study of it with the nominal model of `two-link-tpe`."""
    (folder / "rig.toml").write_text(f'socket = "{server.address}"\njoints = 2\nstep_timeout = 60.0\n{more}')
    nominal = (ROOT / "studies" / "two-link-tpe.toml").read_text().partition("[[nominal.links]]")
    head = f'plant = "rig.toml"\nsampler = "cmaes"\nseed = 1\ntrials = {trials}\n'
    (folder / "find-rig.toml").write_text(head + nominal[1] + nominal[2])
    return folder / "find-rig.toml"


def episode_of(plant: SocketPlant, nominal: Any) -> Objective:
    """Two rich pushes of 60 steps, in factors of `nominal` lumps."""
    return Objective(plant, nominal, Episode(rich_pushes(plant, 2, 4.0, seed=1), 60, fall_limit=3.0), "spectral")


@pytest.fixture(scope="module")
def two_link() -> Any:
    return metaid.load_plant("two-link")


def test_plant_behind_a_socket_gives_the_trials_of_the_built_in_one(serve: Serve, tmp_path: Path) -> None:
    """The same MuJoCo model stepped by another process, its connection lost twice: every factor is the same to the
    last bit, and every value is to the last bit that of the plain loop (the compiled one rounds its sums otherwise).
    """
    server = serve("--body", "mujoco", "--watchdog", "60", "--fault", "drop@700", "--fault", "late@4000")
    found = metaid.run(rig_files(tmp_path, server), storage=str(tmp_path / "rig.db"))
    changes = {"sampler": "cmaes", "trials": 40}
    metaid.run(load_study("two-link-tpe", changes), name="built-in", storage=str(tmp_path / "built-in.db"))
    rig = metaid.trials("find-rig", str(tmp_path / "rig.db"))
    built_in = metaid.trials("built-in", str(tmp_path / "built-in.db"))
    assert (rig["state"] == built_in["state"]).all()
    numbers = [column for column in rig.columns if column != "state"]
    exact = [column for column in numbers if column != "value"]
    assert (rig[exact].to_numpy() == built_in[exact].to_numpy()).all()
    assert rig["value"].to_numpy() == pytest.approx(built_in["value"].to_numpy(), rel=1e-14)
    problem = Problem(load_study("two-link-tpe", changes))
    plant, nominal = problem.make_plant(), problem.nominal.lumps
    for number in (0, 11, 39):
        record, _ = run_plain(plant, nominal.scaled(rig.loc[number, problem.names].to_numpy(float)), problem.episode)
        assert rig.loc[number, "value"] == problem.measure.value(record)
    assert found["true"].isna().all()
    assert server.stops.count("the connection ended") == 2


def test_own_equations_of_the_example_agree_with_mujoco(serve: Serve, two_link: Any) -> None:
    """The default body of the example shares no code with metaid, and an episode shows the same."""
    with closing(rig_at(serve("--watchdog", "60"))) as rig:
        for factor in (1.0, 1.1, 0.9):
            seen, expected = (
                episode_of(plant, two_link.chain.lumps).record(np.full(3, factor)) for plant in (rig, two_link)
            )
            assert seen.steps == expected.steps
            assert seen.acceleration_energy == pytest.approx(expected.acceleration_energy, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize(("fault", "timeout"), [("drop", 60.0), ("late", 60.0), ("silence", 2.0)])
def test_lost_connection_or_message_costs_that_episode_only(
    serve: Serve, two_link: Any, fault: str, timeout: float
) -> None:
    """The episode in which it happens is run again and gives what it would have given."""
    objective = episode_of(rig_at(serve("--fault", f"{fault}@90"), step_timeout=timeout), two_link.chain.lumps)
    undisturbed = episode_of(rig_at(serve()), two_link.chain.lumps)
    with closing(objective), closing(undisturbed):
        for factor in (1.1, 1.05):
            factors = np.full(3, factor)
            assert objective.evaluate(factors) == undisturbed.evaluate(factors)


def test_fall_takes_the_torque_off_at_once(serve: Serve, two_link: Any) -> None:
    """At the step that shows the fall the rig is told to stop, and so it is after every push."""
    server = serve("--watchdog", "60")
    pushes = Episode(np.full((2, 2), 0.02), 1500)
    with closing(Objective(rig_at(server), two_link.chain.lumps, pushes, "spectral")) as objective:
        record = objective.record(np.full(3, 0.5))
        assert objective.record(np.full(3, 1.5)).steps == 3000
    ticks = [int(tick) for tick in re.findall(r"at tick (\d+): asked to", server.log.read_text())]
    assert record.fall_step is not None
    assert record.fall_step < 1500
    assert ticks == [record.fall_step, 1500, 1500]


def test_rig_that_stops_itself_has_fallen(serve: Serve, two_link: Any) -> None:
    """A limit of the rig's own is below the episode's: its stop is a fall at that step, not a lost episode."""
    server = serve("--limit", "15", "--watchdog", "60")
    with closing(episode_of(rig_at(server), two_link.chain.lumps)) as objective:
        outcome = objective.evaluate(np.ones(3))
    assert outcome.fell
    assert 0 < outcome.steps < 60
    assert server.stops[-1] == "a link is past 15°"


def test_watchdog_takes_the_torque_off_when_no_command_comes(serve: Serve) -> None:
    """A driver that goes quiet in mid-episode leaves no torque on, and its next step is refused."""
    server = serve("--watchdog", "0.1")
    with closing(rig_at(server)) as rig:
        rig.push(np.array([0.1, 0.1]))
        while "no command for 0.1 s" not in server.stops:
            time.sleep(0.05)
        with pytest.raises(LostPlant, match=r"stopped: no command for 0.1 s"):
            rig.step()
        rig.push(np.array([0.1, 0.1]))


def test_late_torque_in_real_time_is_noticed(serve: Serve) -> None:
    """A tick that went by without its torque is in the answer's count, and the episode is not trusted."""
    with closing(rig_at(serve("--real-time", "--watchdog", "60"))) as rig:
        rig.push(np.array([0.01, 0.01]))
        time.sleep(0.05)
        with pytest.raises(LostPlant, match=r"a torque came later than its timestep of 0.002 s allows"):
            rig.step()


def test_real_time_changes_no_result(serve: Serve, tmp_path: Path) -> None:
    """A slow pendulum whose ticks take their time shows what it shows as fast as asked."""
    slow = tmp_path / "slow.toml"
    slow.write_text("gravity = 0.2\ntimestep = 0.1\n[[links]]\nlength = 0.5\nmass = 1.0\n")
    nominal = metaid.load_plant(slow).chain.lumps
    shown = []
    for more in (["--real-time"], []):
        rig = rig_at(serve("--watchdog", "60", *more, plant=slow), joints=1, timestep=0.1, gravity=0.2)
        objective = Objective(rig, nominal, Episode(np.array([[0.05]]), 20), "spectral")
        with closing(objective):
            shown.append(objective.evaluate(np.array([1.2])))
    assert shown[0] == shown[1]


@pytest.mark.parametrize("silent", [False, True], ids=["nobody", "silent"])
def test_plant_that_does_not_answer_is_given_up(two_link: Any, silent: bool) -> None:
    """Nobody listens, or somebody who never says a word: a bounded number of tries, each of a bounded time."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        address = f"tcp://127.0.0.1:{listener.getsockname()[1]}"
        if not silent:
            listener.close()
        pushes = Episode(np.array([[0.1, 0.1]]), 60)
        objective = Objective(rig_at(address, step_timeout=0.05), two_link.chain.lumps, pushes, "spectral")
        with pytest.raises(AbsentPlant, match=r"no (answer|connection).*the episode was tried 3 times"):
            objective.evaluate(np.ones(3))


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (b"nonsense\n", "not JSON"),
        (b"[1]\n", "not a JSON object"),
        (b"x" * 70_000, "more than 65536 bytes"),
        (
            b'{"metaid": 1, "joints": 2, "timestep": 0.002, "gravity": 9.81}\n{"tick": 0}\n',
            "no tick, angles and speeds",
        ),
        (
            b'{"metaid": 1, "joints": 2, "timestep": 0.002, "gravity": 9.81}\n'
            b'{"tick": 0, "angles": [0], "speeds": [0]}\n',
            "1 angles and 1 speeds of 2 joints",
        ),
    ],
)
def test_answer_that_is_not_as_agreed_is_one_clear_line(answer: bytes, message: str) -> None:
    """Whatever listens there, the reader is told what came."""
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def talk() -> None:
            connection, _ = listener.accept()
            with connection:
                connection.sendall(answer)
                while connection.recv(4096):
                    pass

        talking = threading.Thread(target=talk)
        talking.start()
        rig = rig_at(f"tcp://127.0.0.1:{listener.getsockname()[1]}")
        with pytest.raises(LostPlant, match=message):
            rig.push(np.zeros(2))
        rig.close()
        talking.join()


@pytest.mark.parametrize(
    ("changes", "said"),
    [({"joints": 3}, "joints = 2"), ({"timestep": 0.001}, "timestep"), ({"gravity": 1.6}, "gravity")],
)
def test_rig_other_than_the_plant_file_says_is_refused(serve: Serve, changes: dict[str, Any], said: str) -> None:
    """Joints, timestep and gravity are what the rig itself says, or nothing is pushed."""
    with closing(rig_at(serve(), **changes)) as rig, pytest.raises(PlantError, match=f"says {said}.*must agree"):
        pushed_speeds(rig, np.array([[0.1] * rig.njoint]))


def test_letting_go_ends_a_wait(serve: Serve) -> None:
    """A run that is interrupted does not sit through the answer that it waits for, and the rig is not called again."""
    server = serve()
    rig = rig_at(server, push_timeout=3000.0)
    rig.round_trips(1)
    server.process.send_signal(signal.SIGSTOP)
    ends: list[str] = []

    def push() -> None:
        try:
            rig.push(np.array([0.1, 0.1]))
        except LostPlant as problem:
            ends.append(str(problem))

    waiting = threading.Thread(target=push)
    waiting.start()
    time.sleep(0.2)
    rig.close()
    waiting.join(timeout=600.0)
    assert not waiting.is_alive()
    assert len(ends) == 1
    with pytest.raises(LostPlant, match="let go"):
        rig.push(np.array([0.1, 0.1]))


def test_unix_socket_serves_as_well(serve: Serve, tmp_path: Path) -> None:
    """The same protocol over unix:PATH."""
    with closing(rig_at(serve(listen=f"unix:{tmp_path / 'rig.sock'}"))) as rig:
        assert (rig.round_trips(3) > 0).all()


def test_bad_message_is_answered_and_moves_nothing(serve: Serve) -> None:
    """A torque that is no finite number never reaches the motors; the rig says what is wrong."""
    host, _, port = serve().address.removeprefix("tcp://").partition(":")
    with socket.create_connection((host, int(port))) as connection, connection.makefile("rwb") as lines:

        def ask(line: bytes) -> dict[str, Any]:
            lines.write(line + b"\n")
            lines.flush()
            answer: dict[str, Any] = json.loads(lines.readline())
            return answer

        ask(b'{"do": "push", "impulses": [0.1, 0.1]}')
        for line in (
            b"{",
            b"7",
            b'{"do": "step", "torque": [1, NaN]}',
            b'{"do": "step", "torque": [1]}',
            b'{"do": "jump"}',
        ):
            assert "error" in ask(line)
        assert ask(b'{"do": "step", "torque": [0, 0]}')["tick"] == 1


def test_study_of_a_rig_is_run_shown_and_reported_without_calling_it_again(
    serve: Serve, metaid: Callable[..., Finished], tmp_path: Path
) -> None:
    """After the run the rig may be switched off: tables, report, figures and the finished run need no plant."""
    server = serve("--watchdog", "60")
    rig_files(tmp_path, server, trials=12)
    assert metaid("plant", "show", "rig.toml").status == 0
    assert metaid("study", "check", "find-rig.toml").status == 0
    assert metaid("study", "create", "find-rig.toml").status == 0
    assert metaid("study", "run", "find-rig").status == 0
    server.process.kill()
    server.process.wait()
    shown = json.loads(metaid("study", "show", "find-rig", "--json").out)
    assert shown["trials"]["total"] == 12
    assert all(lump["true"] is None for lump in shown["lumps"])
    assert metaid("study", "run", "find-rig").status == 0
    assert metaid("study", "report", "find-rig", "-o", "report.html").status == 0
    assert "A rig, drawn by the nominal model" in Path("report.html").read_text()
    gone = metaid("study", "run", "find-rig", "--trials", "20")
    assert gone.status == 2
    assert "no connection to tcp://" in gone.err
    assert len(gone.err.splitlines()) == 1
    assert json.loads(metaid("study", "show", "find-rig", "--json").out)["trials"]["total"] == 12


def test_candidate_that_loses_the_rig_every_time_fails_and_the_run_goes_on(serve: Serve, tmp_path: Path) -> None:
    """Three tries; then the trial is FAIL with its reason, and the next candidate has its turn."""
    path = str(tmp_path / "rig.db")
    server = serve("--body", "mujoco", "--watchdog", "60", *(f"--fault=drop@{step}" for step in (5000, 5001, 5002)))
    metaid.run(rig_files(tmp_path, server, trials=14), storage=path)
    trials = metaid.trials("find-rig", path)
    failed = trials[trials["state"] == "FAIL"]
    assert len(trials) == 14
    assert len(failed) == 1
    reason = (
        optuna.load_study(study_name="find-rig", storage=f"sqlite:///{path}")
        .trials[failed.index[0]]
        .user_attrs["reason"]
    )
    assert "the connection was closed; the episode was tried 3 times" in reason
    assert (trials["state"].iloc[failed.index[0] + 1 :] != "FAIL").all()


def test_run_ends_where_the_rig_dies_and_goes_on_from_there(serve: Serve, tmp_path: Path) -> None:
    """Every episode before it is in the DB, in mid-generation too; in the end the trials are those of a run that was
    never stopped.
    """
    path, listen = str(tmp_path / "rig.db"), f"unix:{tmp_path / 'rig.sock'}"
    dying = serve("--body", "mujoco", "--watchdog", "60", "--fault=die@5000", listen=listen)
    study = rig_files(tmp_path, dying, trials=30)
    with pytest.raises(AbsentPlant, match=r"no connection to unix:.*tried 3 times"):
        metaid.run(study, storage=path)
    kept = metaid.trials("find-rig", path)
    assert len(kept) == int(kept["steps"].cumsum().searchsorted(5000))
    assert len(kept) % 7 > 0
    serve("--body", "mujoco", "--watchdog", "60", listen=listen)
    metaid.run(study, storage=path)
    changes = {"sampler": "cmaes", "trials": 30}
    metaid.run(load_study("two-link-tpe", changes), name="built-in", storage=path)
    again, built_in = metaid.trials("find-rig", path), metaid.trials("built-in", path)
    assert (again[["gravity_1", "steps"]] == built_in[["gravity_1", "steps"]]).all(axis=None)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"workers": 2}, "is one rig: workers is 2"),
        ({"episode.physics": "analytic"}, "its equations of motion are not known"),
    ],
)
def test_setting_that_a_rig_has_no_use_for_is_refused(
    serve: Serve, tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    """One body, one worker; no physics but its own."""
    with pytest.raises(StudyError, match=message):
        load_study(rig_files(tmp_path, serve()), changes)


def test_more_workers_than_bodies_are_refused(serve: Serve, metaid: Callable[..., Finished], tmp_path: Path) -> None:
    """Also when the run asks for them; drawing and filming, which need a simulation, say so."""
    rig_files(tmp_path, serve())
    assert metaid("study", "create", "find-rig.toml").status == 0
    assert "one rig: workers is 2 (allowed: 1)" in metaid("study", "run", "find-rig", "--workers", "2").err
    assert "no links to simulate or draw" in metaid("plant", "draw", "rig.toml", "-o", "rig.png").err


@pytest.mark.parametrize("address", ["127.0.0.1:5555", "tcp://host", "tcp://:1", "udp://host:1", "unix:", "tcp://a:b"])
def test_address_of_another_form_is_refused(metaid: Callable[..., Finished], tmp_path: Path, address: str) -> None:
    """In one line that says which forms there are."""
    (tmp_path / "rig.toml").write_text(f'socket = "{address}"\njoints = 2\n')
    done = metaid("plant", "show", "rig.toml")
    assert done.status == 2
    assert "rig.toml: socket:" in done.err


def test_study_settings_of_a_rig_keep_what_was_measured_at_it(serve: Serve, tmp_path: Path) -> None:
    """The pushes in the DB are the rig's, not the nominal model's, and their floats are exact."""
    study = rig_files(tmp_path, serve("--body", "mujoco"), trials=4)
    metaid.run(study, storage=str(tmp_path / "rig.db"))
    found = metaid.load_findings("find-rig", str(tmp_path / "rig.db"))
    built_in = Problem(load_study("two-link-tpe"))
    spec = load_study("two-link-tpe", {"sampler": "cmaes"})
    assert (found.problem.episode.pushes == Problem(spec).episode.pushes).all()
    assert (found.problem.start_speeds == built_in.start_speeds).all()
    assert not (Problem(load_study(study)).start_speeds == built_in.start_speeds).all()
