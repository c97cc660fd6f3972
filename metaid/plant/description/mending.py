"""URDFs that ROS or Drake reads and MuJoCo does not, made such as all of them read alike."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from xml.etree.ElementTree import Element, SubElement

from metaid.plant.description.repairing import BodyRepair

SEVERAL = {"link": ("visual", "collision")}  # that may stand more than once in an element


def mend_urdf(root: Element) -> tuple[BodyRepair, ...]:
    """Takes away what stands a second time within a link or joint, and an XML namespace of all; declares links on which
    joints hang and that are nowhere else. What was mended, but for the namespace and Drake's `world`.
    """
    for element in root.iter():
        if isinstance(element.tag, str):  # and no comment
            element.tag = element.tag.rpartition("}")[2]
    texts = [*_once(root), *_declared(root)]
    return tuple(BodyRepair(text, ("",)) for text in texts)


def _once(root: Element) -> Iterator[str]:
    """The first counts, as for ROS."""
    for part in (each for kind in ("link", "joint") for each in root.iterfind(kind)):
        for element in list(part.iter()):
            for tag, count in Counter(child.tag for child in element).items():
                if count > 1 and tag not in SEVERAL.get(element.tag, ()):
                    for child in element.findall(tag)[1:]:
                        element.remove(child)
                    where = f"{part.tag} '{part.get('name')}'" + ("" if element is part else f", {element.tag}")
                    yield f"{where}: <{tag}> stands there {count} times: the first is taken"


def _declared(root: Element) -> Iterator[str]:
    """Links without anything, on which joints hang; Drake's `world` is never declared."""
    there = {link.get("name") for link in root.iterfind("link")}
    parents = dict.fromkeys(parent.get("link") for parent in root.iterfind("joint/parent"))
    for name in parents:
        if name and name not in there:
            SubElement(root, "link", {"name": name})
            if name != "world":
                yield f"link '{name}', on which a joint hangs, is not there: an empty one is taken"
