"""The identified model of a study as files to use elsewhere: plant file, MJCF, URDF, the law in Python and C, JSON.

`identified_model` reads it from a study; `chain_dynamics` and `arm_dynamics` make what is written of lumps or base
parameters alone. `file_torques` loads a file again and says what torques it predicts.
"""

from metaid.errors import StudyError
from metaid.results.arms import AnySnapshot, ArmSnapshot, read_any_snapshot
from metaid.results.exporting.arm_studies import identified_arm
from metaid.results.exporting.chain_studies import identified_chain
from metaid.results.exporting.dynamics import Dynamics, arm_dynamics, chain_dynamics
from metaid.results.exporting.identified import SUFFIXES, IdentifiedModel, covariance_frame
from metaid.results.exporting.laws import ArmLaw
from metaid.results.exporting.reading_back import FileTorques, file_torques
from metaid.results.exporting.xml_files import Couple, couples_of, mjcf, not_in_urdf, not_in_xml, urdf
from metaid.store import Store
from metaid.study import AnySpec, ArmSpec, with_nominal

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
    "covariance_frame",
    "file_torques",
    "identified_model",
    "mjcf",
    "not_in_urdf",
    "not_in_xml",
    "started_from",
    "urdf",
]


def identified_model(snapshot: AnySnapshot, even_if_not_found: bool = False) -> IdentifiedModel:
    """What a study identified; where its verdict is not `found`, and `even_if_not_found` asks for it, its last estimate
    or its best trial.  Raises StudyError where it identified nothing, and says why.
    """
    if isinstance(snapshot, ArmSnapshot):
        return identified_arm(snapshot, even_if_not_found)
    return identified_chain(snapshot, even_if_not_found)


def started_from(store: Store, spec: AnySpec, other: str) -> AnySpec:
    """A study whose nominal model is what the study `other` in the DB identified.  Raises StorageError, and StudyError
    where that has identified nothing, or another kind of plant.
    """
    found = identified_model(read_any_snapshot(store, other))
    changed = with_nominal(spec, found.nominal)
    gravity = spec.nominal.gravity if isinstance(spec, ArmSpec) else spec.plant.gravity
    if found.gravity != gravity:
        raise StudyError(
            f"study {spec.name}: its plant's gravity is {gravity} m/s², that of study '{other}' {found.gravity}: they "
            "must agree, it is not searched"
        )
    return changed
