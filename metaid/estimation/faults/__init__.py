"""Faults of the plant as unknowns of the fit, beside the lumps.

faults = searched_faults(("delay", "tilt"), nominal, gravity, start_speeds)
estimate = fit(Readings(trials, unknowns, gravity, faults=faults))
estimate.faults.values
"""

from metaid.estimation.faults.searched import NO_FAULTS, FoundFaults, SearchedFaults, found_faults, searched_faults

__all__ = ["NO_FAULTS", "FoundFaults", "SearchedFaults", "found_faults", "searched_faults"]
