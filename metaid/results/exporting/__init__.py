"""The identified model of a study as files to use elsewhere: plant file, MJCF, URDF, the law in Python and C, JSON.

`identified_model` reads it from a study; `chain_dynamics` and `arm_dynamics` make what is written of lumps or base
parameters alone. `file_torques` loads a file again and says what torques it predicts.
"""

from metaid.results.exporting.dynamics import Dynamics, arm_dynamics, chain_dynamics
from metaid.results.exporting.identified import SUFFIXES, IdentifiedModel
from metaid.results.exporting.laws import ArmLaw
from metaid.results.exporting.reading_back import FileTorques, file_torques
from metaid.results.exporting.studies import identified_model, started_from
from metaid.results.exporting.xml_files import Couple, couples_of, mjcf, not_in_urdf, not_in_xml, urdf

__all__ = [
    "SUFFIXES",
    "ArmLaw",
    "Couple",
    "Dynamics",
    "FileTorques",
    "IdentifiedModel",
    "arm_dynamics",
    "chain_dynamics",
    "couples_of",
    "file_torques",
    "identified_model",
    "mjcf",
    "not_in_urdf",
    "not_in_xml",
    "started_from",
    "urdf",
]
