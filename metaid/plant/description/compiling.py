"""MuJoCo compiles the user's whole MJCF or URDF, without the meshes and textures that cannot be loaded."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree

from metaid.errors import PlantError
from metaid.plant.asked import SCHEME, refuse_absurd_sizes
from metaid.plant.description.mending import mend_urdf
from metaid.plant.description.repairing import BodyRepair, repair_inertias, repair_joints
from metaid.plant.lean import mujoco

_BROKEN = (ValueError, RuntimeError, MemoryError, mujoco.FatalError)
_warning_lock = threading.RLock()


@dataclass(frozen=True, eq=False)
class CompiledFile:
    """The `model` of a whole file, the meshes that cannot be loaded (`lost`), and what was mended."""

    model: mujoco.MjModel
    lost: tuple[str, ...] = ()
    repairs: tuple[BodyRepair, ...] = ()


def compile_file(path: Path, is_urdf: bool) -> CompiledFile:
    """The compiled whole of an MJCF or URDF. Meshes that cannot be loaded are left out where only shapes are lost.
    Textures that cannot be loaded are left out, too. What is impossible is repaired. A link of a URDF weighs what its
    `<inertial>` says, and nothing without.

    Raises PlantError where it cannot be read or compiled, or a link's mass is that of a mesh that cannot be loaded.
    """
    kind, root = ("URDF", "robot") if is_urdf else ("MJCF", "mujoco")
    found = _root(path, kind)
    if found != root:
        raise PlantError(f"{path}: no {kind}: it begins with <{found}> (allowed: <{root}>)")
    refuse_absurd_sizes(path)
    _refuse_xacro(path)
    with gathered_warnings() as warned:
        with _attempting(path, "read"):
            spec, mended = _read(path, is_urdf)
            if any("NaN" in warning for warning in warned):
                raise PlantError(f"{path}: a number in it is NaN (allowed: finite numbers)")
            _prepare(spec, path, is_urdf)
        with _attempting(path, "compile"):
            compiled = _compile(spec, path, is_urdf)
    try:
        compiled.model.names.decode()
    except UnicodeDecodeError:
        raise PlantError(f"{path}: a name in it is not UTF-8 (allowed: names that are)") from None
    return replace(compiled, repairs=(*mended, *compiled.repairs, *repair_joints(compiled.model)))


def _read(path: Path, is_urdf: bool) -> tuple[mujoco.MjSpec, tuple[BodyRepair, ...]]:
    """The file as it is, or a URDF such as MuJoCo reads it, and what was mended in it."""
    if is_urdf:
        with suppress(ElementTree.ParseError, ValueError, LookupError):  # MuJoCo says so, or is less strict
            root = ElementTree.parse(path).getroot()
            before = ElementTree.tostring(root)
            mended = mend_urdf(root)
            if (text := ElementTree.tostring(root)) != before:
                spec = mujoco.MjSpec.from_string(text.decode())
                spec.modelfiledir = str(path.resolve().parent)
                return spec, mended
    return mujoco.MjSpec.from_file(str(path)), ()


def _prepare(spec: mujoco.MjSpec, path: Path, is_urdf: bool) -> None:
    """Says where meshes are, and that links without an inertial weigh nothing in a URDF."""
    for body in spec.bodies if is_urdf else ():
        for geom in () if _weighs_as_said(spec, body) else body.geoms:
            geom.density = 0.0
    for mesh in spec.meshes:
        mesh.file = _found(mesh.file, path)


def _compile(spec: mujoco.MjSpec, path: Path, is_urdf: bool) -> CompiledFile:
    """The file as it is, else without what cannot be loaded, else with inertias that can be."""
    with suppress(*_BROKEN):
        return CompiledFile(spec.copy().compile())
    lost = _leave_out_lost_meshes(spec, path)
    _leave_out_textures(spec)
    with suppress(*_BROKEN):
        return CompiledFile(spec.copy().compile(), lost)
    repairs = repair_inertias(spec, lambda body: is_urdf or _weighs_as_said(spec, body) or not body.geoms)
    return CompiledFile(spec.compile(), lost, repairs)


@contextmanager
def _attempting(path: Path, what: str) -> Iterator[None]:
    try:
        yield
    except _BROKEN as problem:
        raise PlantError(f"{path}: MuJoCo cannot {what} it: {problem}") from None


@contextmanager
def gathered_warnings() -> Iterator[list[str]]:
    """Within it what MuJoCo warns of is gathered, where it would be printed and written into a log file.

    The callback is a variable of MuJoCo's library, so one thread at a time is within it.
    """
    gathered: list[str] = []
    with _warning_lock, warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # the same, of Python's binding
        before = mujoco.get_mju_user_warning()
        mujoco.set_mju_user_warning(gathered.append)
        try:
            yield gathered
        finally:
            mujoco.set_mju_user_warning(before)


def _root(path: Path, kind: str) -> str:
    """The name of the first element of an XML file."""
    try:
        if path.exists() and not path.is_file():
            raise PlantError(f"{path}: not a file (allowed: the path of an {kind} file)")
        with path.open("rb") as file:
            _, element = next(ElementTree.iterparse(file, events=("start",)))
    except OSError as problem:
        raise PlantError(f"{path}: {problem.strerror} (allowed: the path of an {kind} file)") from None
    except (ElementTree.ParseError, ValueError) as problem:
        raise PlantError(f"{path}: not valid XML: {problem}") from None
    return str(element.tag).rpartition("}")[2]


def _refuse_xacro(path: Path) -> None:
    """Raises PlantError where a URDF is still to be expanded. What xacro leaves beside links and joints does not
    matter.
    """
    found = "it ends with .xacro" if path.suffix == ".xacro" else ""
    try:
        parts = list(ElementTree.parse(path).getroot())
    except (ElementTree.ParseError, ValueError, LookupError):
        return  # MuJoCo says so, or is less strict
    for part in parts:
        space, _, kind = part.tag.rpartition("}")
        if space.endswith("xacro") and kind not in ("property", "arg", "macro"):
            found = found or f"<xacro:{kind}> is in it"
        elif kind in ("link", "joint"):
            texts = (text for each in part.iter() if each.tag != "mesh" for text in each.attrib.values())
            left = next((text for text in texts if "${" in text or "$(" in text), None)
            found = found or (f"'{left}' is in <{kind}>" if left else "")
    if found:
        raise PlantError(f"{path}: {found} (allowed: what xacro makes of it: xacro {path.stem}.xacro > robot.urdf)")


def _weighs_as_said(spec: mujoco.MjSpec, body: mujoco.MjsBody) -> bool:
    """Whether the body's mass is as the file says, and not inferred from its shapes."""
    is_inferred = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    return not is_inferred and bool(body.explicitinertial)


def _found(file: str, path: Path) -> str:
    """Where the file of a mesh is: one that is said to be in a package is searched in the folders above."""
    if SCHEME not in file:
        return file
    named = file.partition(SCHEME)[2]
    places = (folder / named.lstrip("/") for folder in path.resolve().parents)
    return next((str(place) for place in places if place.is_file()), file)


def _leave_out_lost_meshes(spec: mujoco.MjSpec, path: Path) -> tuple[str, ...]:
    """Takes the meshes away that cannot be loaded, and the shapes that they are; which these were."""
    lost = {mesh.name or Path(mesh.file).stem: mesh for mesh in spec.meshes if not _loads(spec, mesh)}
    low, high = spec.compiler.inertiagrouprange
    for geom in [geom for geom in spec.geoms if geom.meshname in lost]:
        weighs = low <= geom.group <= high and geom.density and geom.mass != 0.0
        if weighs and not _weighs_as_said(spec, geom.parent):
            raise PlantError(
                f"{path}: the mass of body '{geom.parent.name}' is that of the mesh {lost[geom.meshname].file}, which "
                f"cannot be loaded (allowed: a mesh that can, or an <inertial>)"
            )
        spec.delete(geom)
    files = tuple(mesh.file for mesh in lost.values())
    for mesh in lost.values():
        spec.delete(mesh)
    return files


def _leave_out_textures(spec: mujoco.MjSpec) -> None:
    for texture in list(spec.textures):
        spec.delete(texture)
    for material in spec.materials:
        material.textures = [""] * len(list(material.textures))


def _loads(spec: mujoco.MjSpec, mesh: mujoco.MjsMesh) -> bool:
    """Whether MuJoCo can make a shape of the mesh alone."""
    alone = mujoco.MjSpec()
    alone.modelfiledir, alone.strippath = spec.modelfiledir, spec.strippath
    alone.compiler.meshdir = spec.compiler.meshdir
    alone.add_mesh(name="mesh", file=mesh.file, content_type=mesh.content_type, scale=mesh.scale, inertia=mesh.inertia)
    alone.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="mesh")
    try:
        alone.compile()
    except _BROKEN:
        return False
    return True
