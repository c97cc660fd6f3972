"""A plant behind a socket, with things going wrong: its episodes and its protocol."""

from __future__ import annotations

import json
import re
import signal
import socket
import threading
import time
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rig import Serve, rig_at, serving

import metaid
from metaid.compiled import Objective
from metaid.episode import Episode, FallRule, Outcome, pushed_speeds, rich_pushes
from metaid.errors import AbsentPlant, LostPlant, PlantError
from metaid.plant import SocketPlant, Start

pytestmark = pytest.mark.slow


def episode_of(plant: SocketPlant, nominal: Any) -> Objective:
    """Two rich pushes of 60 steps, in factors of `nominal` lumps."""
    return Objective(plant, nominal, Episode(rich_pushes(plant, 2, 4.0, seed=1), 60, FallRule(3.0)), "spectral")


@pytest.fixture(scope="module")
def two_link() -> Any:
    return metaid.load_plant("two-link")


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory, two_link: Any) -> dict[float, Outcome]:
    """What a rig shows, by the factor of all lumps, where nothing goes wrong."""
    folder, lumps = tmp_path_factory.mktemp("rig"), two_link.chain.lumps
    with serving(folder) as serve, closing(episode_of(rig_at(serve()), lumps)) as objective:
        return {factor: objective.evaluate(np.full(3, factor)) for factor in (1.1, 1.05)}


def test_own_equations_of_the_example_agree_with_mujoco(serve: Serve, two_link: Any) -> None:
    """The default body of the example shares no code with metaid, and an episode shows the same."""
    with closing(rig_at(serve("--stepped", "--watchdog", "60"))) as rig:
        for factor in (1.0, 1.1, 0.9):
            seen, expected = (
                episode_of(plant, two_link.chain.lumps).record(np.full(3, factor)) for plant in (rig, two_link)
            )
            assert seen.total_steps == expected.total_steps
            assert seen.acceleration_energy == pytest.approx(expected.acceleration_energy, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize(("fault", "timeout"), [("drop", 60.0), ("late", 60.0), ("silence", 1.0)])
def test_lost_connection_or_message_costs_that_episode_only(
    serve: Serve, two_link: Any, undisturbed: dict[float, Outcome], fault: str, timeout: float
) -> None:
    """The episode in which it happens is run again and gives what it would have given."""
    objective = episode_of(rig_at(serve("--fault", f"{fault}@90"), step_timeout=timeout), two_link.chain.lumps)
    with closing(objective):
        for factor, outcome in undisturbed.items():
            assert objective.evaluate(np.full(3, factor)) == outcome


def test_fall_takes_the_torque_off_at_once(serve: Serve, two_link: Any) -> None:
    """At the step that shows the fall the rig is told to stop, and so it is after every push."""
    server = serve("--watchdog", "60", "--verbose")
    pushes = Episode(np.full((2, 2), 0.02), 700)  # it falls after 615
    with closing(Objective(rig_at(server), two_link.chain.lumps, pushes, "spectral")) as objective:
        record = objective.record(np.full(3, 0.5))
        assert objective.record(np.full(3, 1.5)).total_steps == 1400
    ticks = [int(tick) for tick in re.findall(r"at tick (\d+): asked to", server.log.read_text())]
    assert record.fall_step is not None
    assert record.fall_step < 700
    assert ticks == [record.fall_step, 700, 700]


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
        rig.push(Start.upright(np.array([0.1, 0.1])))
        while "no command for 0.1 s" not in server.stops:
            time.sleep(0.05)
        with pytest.raises(LostPlant, match=r"stopped: no command for 0.1 s"):
            rig.step()
        rig.push(Start.upright(np.array([0.1, 0.1])))


def test_late_torque_in_real_time_is_noticed(serve: Serve) -> None:
    """A tick that went by without its torque is in the answer's count, and the episode is not trusted."""
    with closing(rig_at(serve("--real-time", "--watchdog", "60"))) as rig:
        rig.push(Start.upright(np.array([0.01, 0.01])))
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
        objective = Objective(rig, nominal, Episode(np.array([[0.05]]), 10), "spectral")
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
            rig.push(Start.upright(np.zeros(2)))
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
            rig.push(Start.upright(np.array([0.1, 0.1])))
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
        rig.push(Start.upright(np.array([0.1, 0.1])))


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
