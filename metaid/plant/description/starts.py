"""Where the pushes of an arm begin: poses all over the joint ranges, from which it coasts without touching anything.

The arm is to coast: where the law is right, joint speeds stay what they are. So where it goes is known beforehand. It
stays within its ranges, and MuJoCo's own geometry of the user's whole file says whether it stays clear of itself, of
the floor and of what stands around it. Shapes that are as near each other at home are taken to belong together, as
MuJoCo takes those of a link and the next.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from copy import copy
from itertools import islice

import numpy as np

from metaid.errors import PlantError
from metaid.models import Array
from metaid.models.tree import Tree
from metaid.plant.arm_plant import ArmPlant
from metaid.plant.description.compiling import gathered_warnings
from metaid.plant.description.fusing import Whole, body_name
from metaid.plant.lean import mujoco
from metaid.plant.start import ArmStart

SPEED = 3.0  # rad/s, of the fastest joint at most
SLIDE = 1.0 / 3.0  # m/s of a slide for each rad/s of a hinge
REACH = 0.5  # m to and fro, of a slide without limits
MARGIN = 0.1  # of a joint's range that stays free at each end: no arm coasts exactly
CLEARANCE = 0.02  # m between shapes
FINE = 0.05  # rad or m that a joint moves from one look to the next
DRAWS = 2000  # of one start, before it is given up


def draw_starts(plant: ArmPlant, count: int, horizon: float, seed: int, speed: float = SPEED) -> tuple[ArmStart, ...]:
    """Starts of coasts. The same seed gives the same; the masses of the arm do not matter.

    Args:
        plant: that is pushed.
        count: the number of starts.
        horizon: of a coast, in s.
        seed: of the random numbers.
        speed: of the fastest joint at most, in rad/s; a slide has a third of it in m/s. Where a range is too short for
            a coast at that speed, its joint is slower.

    Raises:
        PlantError: nowhere was the arm seen to stay clear.
    """
    proposals = _proposals(plant.tree, _ranges(plant.tree, plant.home), horizon, seed, speed)
    with gathered_warnings():
        try:
            clear = Clearance(plant.arm.whole, plant.home)
            return tuple(_clear_start(plant.name, clear, proposals, horizon) for _ in range(count))
        except mujoco.FatalError as problem:
            raise PlantError(f"plant {plant.name}: MuJoCo cannot tell what touches what: {problem}") from None


def draw_free_starts(tree: Tree, count: int, horizon: float, seed: int, speed: float = SPEED) -> tuple[ArmStart, ...]:
    """The same for an arm without shapes, as the simulated one is: its coasts stay within the joint ranges.

    Args:
        tree: that is pushed.
        count: the number of starts.
        horizon: of a coast, in s.
        seed: of the random numbers.
        speed: of the fastest joint at most, in rad/s; see `draw_starts`.
    """
    proposals = _proposals(tree, _ranges(tree, np.zeros(tree.njoint)), horizon, seed, speed)
    return tuple(islice(proposals, count))


def _ranges(tree: Tree, home: Array) -> Array:
    """From where to where the joints may move (2 x njoint), in rad or m."""
    low, high = tree.ranges(np.pi, REACH, np.where(tree.slides, home, 0.0))
    margin = MARGIN * (high - low)
    return np.stack([low + margin, high - margin])


def _proposals(tree: Tree, ranges: Array, horizon: float, seed: int, speed: float) -> Iterator[ArmStart]:
    """Starts without end from which an ideal coast stays within the `ranges` (2 x njoint)."""
    random = np.random.Generator(np.random.SFC64([seed]))
    low, high = ranges
    fastest = np.minimum(np.where(tree.slides, SLIDE * speed, speed), 0.5 * (high - low) / horizon)
    while True:
        speeds = fastest * random.uniform(-1.0, 1.0, tree.njoint)
        way = horizon * speeds
        first = low - np.minimum(way, 0.0)
        pose = first + (high - np.maximum(way, 0.0) - first) * random.uniform(size=tree.njoint)
        yield ArmStart(pose, speeds)


def _clear_start(name: str, clear: Clearance, proposals: Iterator[ArmStart], horizon: float) -> ArmStart:
    """The first of the `proposals` whose coast, so many s long, stays clear."""
    met: Counter[str] = Counter()
    for start in islice(proposals, DRAWS):
        way = horizon * start.speeds
        looks = np.linspace(0.0, 1.0, 1 + int(np.ceil(np.abs(way).max() / FINE)))
        touching = next((pair for share in looks if (pair := clear.met(start.pose + share * way))), None)
        if touching is None:
            return start
        met[touching] += 1
    pair, often = met.most_common(1)[0]
    raise PlantError(
        f"plant {name}: no start was found from which a coast of {horizon:g} s stays clear: in {often} of "
        f"{DRAWS} draws {pair} came within {CLEARANCE:g} m (allowed: shapes that are clear of each other in some of "
        "the poses; those that may touch have contype 0 and conaffinity 0)"
    )


class Clearance:
    """Whether an arm touches itself or what stands around it."""

    def __init__(self, whole: Whole, home: Array) -> None:
        """Of a file at `home` (njoint), where what is near each other belongs together."""
        self._whole, self._model = whole, copy(whole.model)
        self._model.geom_margin[:] = self._model.body_margin[:] = CLEARANCE
        self._data = mujoco.MjData(self._model)
        self._together: set[tuple[int, int]] = set()
        self._together = set(self._pairs(home))

    def met(self, coordinates: Array) -> str | None:
        """Which shapes are too near each other at these `coordinates` (njoint); None where none are."""
        for pair in self._pairs(coordinates):
            first, second = (self._name(geom) for geom in pair)
            return f"{first} and {second}"
        return None

    def _pairs(self, coordinates: Array) -> list[tuple[int, int]]:
        self._data.qpos[:] = self._whole.at(coordinates)
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_collision(self._model, self._data)
        if not self._data.ncon:
            return []
        contacts = self._data.contact
        near = contacts.geom[contacts.dist < CLEARANCE]
        pairs = ((min(geoms), max(geoms)) for geoms in near.tolist())
        return [pair for pair in pairs if pair not in self._together]

    def _name(self, geom: int) -> str:
        """Of a shape; where it has none, that of its body."""
        own = self._model.geom(geom).name
        body = body_name(self._model, int(self._model.geom_bodyid[geom]))
        return f"'{own}'" if own else f"a shape of body '{body}'"
