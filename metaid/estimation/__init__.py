"""What all trials of a study say of a robot: the one that, simulated under the very laws that were sent, shows what was
seen. In robot identification this is the closed-loop output-error method; docs/method.md has its equations.

    trials = [WatchedTrial(law, timestep, starts, windows), ...]
    estimate = fit(Motions(trials, LogUnknowns(nominal, gravity)))

What is unknown is a chain's `LogUnknowns`, of which its lumps are a view, or an arm's `BaseUnknowns`. All trials
are used, whichever sampler proposed their laws. A trial that ended in a fall is used up to the fall. `Motions` compares
windows of plants without noise, `Readings` what the sensors of a noisy plant read. An `Experiment` is all of this for a
study. Nothing here knows of files, studies or the truth. What an estimate says is read without numba, which is loaded
when one is made.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from metaid.estimation.approximation import Approximation, HeldOutPushes, Prediction
from metaid.estimation.base_unknowns import ArmEstimate, BaseUnknowns
from metaid.estimation.descent import FARTHEST, Residuals, descend, place_at
from metaid.estimation.estimate import Found
from metaid.estimation.faults import FoundFaults, Proposal, SearchedFaults, TakenUp, Unmodelled, searched_faults
from metaid.estimation.fit import fit, starting_points
from metaid.estimation.laws import ArmLaws, ChainLaws
from metaid.estimation.log_unknowns import Estimate, LogUnknowns
from metaid.estimation.trials import ReadTrial, Replay, WatchedTrial, upright

if TYPE_CHECKING:
    from metaid.estimation.crossings import MISS, TOP, Counters, count_crossings
    from metaid.estimation.experiment import Experiment, SeenTrial
    from metaid.estimation.motions import Motions, Quantity, WatchedTrials
    from metaid.estimation.noisy import Loop, Readings


_LOADS_NUMBA = dict.fromkeys(("Motions", "Quantity", "WatchedTrials"), "motions")
_LOADS_NUMBA |= dict.fromkeys(("Loop", "Readings"), "noisy")
_LOADS_NUMBA |= dict.fromkeys(("Experiment", "SeenTrial"), "experiment")
_LOADS_NUMBA |= dict.fromkeys(("MISS", "TOP", "Counters", "count_crossings"), "crossings")


def __getattr__(name: str) -> Any:
    if name in _LOADS_NUMBA:
        return getattr(import_module(f"metaid.estimation.{_LOADS_NUMBA[name]}"), name)
    raise AttributeError(f"module 'metaid.estimation' has no attribute '{name}'")
