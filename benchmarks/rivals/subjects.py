"""What is identified: a chain of so many links that a seed means, or an arm of so many joints."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from benchmarks.chains import Links, random_chain
from benchmarks.rivals.arm_model import ArmModel, misplaced, record_arm
from benchmarks.rivals.benched import Benched, arm_on_bench, chain_on_bench, output_error_on_bench
from benchmarks.rivals.conditions import CONDITIONS, SHIFT, TURN, Condition
from benchmarks.rivals.judging import Error, Found, judge_arm, judge_chain
from benchmarks.rivals.logs import Log, record
from metaid.episode import natural_time
from metaid.models import Array
from metaid.models.tree import ArmPrior, PriorDeviations
from metaid.plant import ArmPlant, PlantSettings, chain_of, load_plant
from metaid.study import drawn_nominal

GRAVITY: float = PlantSettings.model_fields["gravity"].default
ARMS = {6: "puma560", 7: "pa10"}  # by the number of joints


class Subject(Protocol):
    """A rig in some condition, and what is believed of it."""

    @property
    def count(self) -> int:
        """How many parameters are to be found."""
        ...

    def record(self, seconds: float, by_drives: bool) -> Log:
        """It along exciting trajectories; see `logs.record`."""
        ...

    def pushed(self, seconds: float) -> Found:
        """What metaid finds by pushes."""
        ...

    def judge(self, parameters: Array) -> Error:
        """How wrong parameters are that a method found."""
        ...


@dataclass(frozen=True)
class ChainSubject:
    """The chain of so many `links` that a `seed` means."""

    condition: Condition
    links: int
    seed: int

    @cached_property
    def _links(self) -> tuple[Links, Links]:
        """True and nominal."""
        true, nominal = random_chain(self.links, self.seed)
        return true, self.condition.believed(nominal, self.seed)

    @property
    def count(self) -> int:
        return self.links * (self.links + 1) // 2 + self.links

    def record(self, seconds: float, by_drives: bool) -> Log:
        return record(*self._links, self.condition, seconds, self.seed, by_drives)

    def pushed(self, seconds: float) -> Found:
        benched = chain_on_bench(*self._links, self.condition, self.seed)
        return output_error_on_bench(benched, self.condition, seconds, self.seed)

    def judge(self, parameters: Array) -> Error:
        true, nominal = (chain_of(links) for links in self._links)
        return judge_chain(parameters, true, GRAVITY, natural_time(nominal, GRAVITY))


@dataclass(frozen=True)
class ArmSubject:
    """An arm with so many `joints`, whose nominal model a `seed` draws."""

    condition: Condition
    joints: int
    seed: int

    @cached_property
    def plant(self) -> ArmPlant:
        """The rig."""
        plant = load_plant(ARMS[self.joints])
        assert isinstance(plant, ArmPlant)
        return plant

    @cached_property
    def prior(self) -> ArmPrior:
        """What everybody believes."""
        nominal = drawn_nominal(self.plant.tree, self.seed, PriorDeviations())
        return ArmPrior(misplaced(nominal, self.seed, SHIFT, TURN) if self.condition.misplaced else nominal)

    @property
    def count(self) -> int:
        return len(self.prior.values)

    def record(self, seconds: float, by_drives: bool) -> Log:
        model = ArmModel(self.prior, self.plant.timestep)
        return record_arm(self.plant.tree, model, self.condition, seconds, self.seed, self._benched)

    @property
    def _benched(self) -> Benched:
        return arm_on_bench(self.plant, self.prior, self.condition)

    def pushed(self, seconds: float) -> Found:
        return output_error_on_bench(self._benched, self.condition, seconds, self.seed)

    def judge(self, parameters: Array) -> Error:
        return judge_arm(np.asarray(parameters), self.plant.tree, self.prior)


def subject_of(condition: str, links: int, seed: int) -> Subject:
    """The rig that is meant."""
    if links in ARMS:
        return ArmSubject(CONDITIONS[condition], links, seed)
    return ChainSubject(CONDITIONS[condition], links, seed)
