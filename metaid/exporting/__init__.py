"""The identified model, of a study or of logs, as files: plant file, MJCF, URDF, the law in Python and C, JSON.

`chain_dynamics` and `arm_dynamics` make what is written of lumps or base parameters alone. `file_torques` loads a file
again and says what torques it predicts.
"""

from metaid.exporting.dynamics import Dynamics, arm_dynamics, chain_dynamics
from metaid.exporting.identified import SUFFIXES, IdentifiedModel
from metaid.exporting.laws import ArmLaw
from metaid.exporting.reading_back import file_torques
from metaid.exporting.xml_files import mjcf, not_in_urdf, not_in_xml, urdf
