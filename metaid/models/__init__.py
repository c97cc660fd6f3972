"""What is unknown, and the law that follows from it.

A planar chain has lumped parameters (`Lumps`), which make the compensation torque, its regressor and the mass matrix.
`Chain` holds the physical parameters that lumps follow from; `body_extents` says which bodies lumps leave possible.
Pure functions of arrays: nothing here knows MuJoCo, Optuna or files.
"""

from metaid.models.chain import Chain, speeds_after
from metaid.models.chain_of_lumps import chain_of_lumps
from metaid.models.closest_bodies import Matrices
from metaid.models.intervals import COARSEST, DEVIATIONS, deviations_at_once, half_width, jackknife
from metaid.models.known_lumps import KnownLumps, known_lumps
from metaid.models.law import SLIDING, ChainModel, Trajectory, compensation_basis, mass_matrix
from metaid.models.lumps import (
    FRICTION,
    IDEAL,
    LARGEST_FACTOR,
    UNITS,
    Array,
    Lumps,
    coriolis_of,
    factors_from_names,
    kind_of,
    lump_names,
    lump_unit,
)
from metaid.models.nearest_bodies import Nearest
from metaid.models.possible import (
    least_inertia,
    question_of_distances,
    question_of_units,
    refuse_impossible,
    refuse_too_long_a_step,
)
from metaid.models.possible_bodies import body_extents
