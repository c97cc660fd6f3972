"""A serial arm in space: links that hinges and slides join, each after the one before.

`Tree` holds its kinematics and its inertial and friction parameters. Its torque is linear in these (`torque_regressor`)
and depends on some combinations alone, the `BaseParameters`. An `ArmPrior` says how wrong a nominal arm may be.
`JointFriction` is what friction real joints have.
"""

from metaid.models.tree.arm_prior import ArmPrior, PriorDeviations
from metaid.models.tree.base import BaseParameters, base_parameters, random_states, seen_by_bias
from metaid.models.tree.bodies import (
    nearest_possible,
    nominal_pseudo_inertias,
    possible_bodies,
    pseudo_inertia,
    thick_links,
)
from metaid.models.tree.dynamics import Dynamics, arm_dynamics, joint_mass_matrix
from metaid.models.tree.joint_friction import COLUMNS, SHARED, JointFriction, Sliding, Spring, friction_torque
from metaid.models.tree.known_bodies import body_quantities, known_bodies
from metaid.models.tree.misplaced import MISPLACED, last_link_turned, misplaced
from metaid.models.tree.model_error import ModelError, difference, model_error, torque_half_width, torque_rows
from metaid.models.tree.planar import is_pendulum, planar_chain, planar_tree, turning
from metaid.models.tree.regressor import (
    joint_torque,
    kinetic_squares,
    rigid_torque,
    torque_columns,
    torque_regressor,
)
from metaid.models.tree.tree import PARAMETERS, Tree, inertia_matrices, tilted_gravity
