"""Faults of the plant as unknowns of the fit, beside the lumps, and what is said of them. No numba is loaded here.

faults = searched_faults(("delay", "tilt"), unknowns, start_speeds)
estimate = fit(Readings(trials, unknowns, faults=faults))
estimate.faults.values
"""

from metaid.estimation.faults.explaining import Proposal, TakenUp, fault_sizes, named_faults
from metaid.estimation.faults.forces import GEOMETRY, Unmodelled
from metaid.estimation.faults.searched import (
    NO_FAULTS,
    FoundFaults,
    SearchedFaults,
    found_faults,
    late,
    searched_faults,
)
