"""What is unknown, and the law that follows from it.

A planar chain has lumped parameters (`Lumps`), which make the compensation torque, its regressor and the mass matrix.
`Chain` holds the physical parameters that lumps follow from, `Bodies` those that a study may search in their place.
Pure functions of arrays: nothing here knows MuJoCo, Optuna or files.
"""

from metaid.models.bodies import Bodies, bodies_of
from metaid.models.chain import Chain, speeds_after
from metaid.models.law import SLIDING, compensation_basis, compensation_torque, mass_matrix
from metaid.models.lumps import FRICTION, IDEAL, Array, Candidates, Lumps, factors_from_names, lump_names, lump_unit
from metaid.models.possible import least_inertia, refuse_impossible, refuse_too_long_a_step
from metaid.models.same_motion import SameMotion

__all__ = [
    "FRICTION",
    "IDEAL",
    "SLIDING",
    "Array",
    "Bodies",
    "Candidates",
    "Chain",
    "Lumps",
    "SameMotion",
    "bodies_of",
    "compensation_basis",
    "compensation_torque",
    "factors_from_names",
    "least_inertia",
    "lump_names",
    "lump_unit",
    "mass_matrix",
    "refuse_impossible",
    "refuse_too_long_a_step",
    "speeds_after",
]
