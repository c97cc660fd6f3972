"""A serial arm in space: links that hinges and slides join, each after the one before.

`Tree` holds its kinematics and its inertial and friction parameters.
"""

from metaid.models.tree.tree import PARAMETERS, Tree

__all__ = ["PARAMETERS", "Tree"]
