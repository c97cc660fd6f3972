"""The licence of each dependency, and whether metaid may be used with it by anyone."""

from __future__ import annotations

import re
from collections.abc import Collection
from importlib.metadata import Distribution
from typing import NamedTuple

from packaging.utils import canonicalize_name

# Permissive ones; and those that ask only for changes of their own files (MPL), or for being replaceable (LGPL), of
# what is imported as it is.
ALLOWED = {
    *("0BSD", "Apache-2.0", "BSD", "BSD-2-Clause", "BSD-3-Clause", "BSL-1.0", "CC0-1.0", "ISC", "MIT", "MIT-CMU"),
    *("PSF-2.0", "Qhull", "Zlib", "MPL-2.0", "LGPL-3.0-only"),
}
# Of tools of development, which are not shipped with metaid, nor needed by it: any LGPL.
ALLOWED_IN_DEVELOPMENT = {*ALLOWED, "LGPL-3.0-or-later"}


class Reading(NamedTuple):
    """The `licence` of a `version` of a package, as a person read it at `source`."""

    version: str
    licence: str
    source: str


# Of packages whose metadata state none. Another version has to be read again.
READ_BY_HAND = {
    "cmeel-qhull": Reading("8.0.2.1", "Qhull", "COPYING.txt of the package and of https://github.com/qhull/qhull"),
}
SPDX = {
    "3-Clause BSD License": "BSD-3-Clause",
    "Apache 2.0": "Apache-2.0",
    "Apache Software License": "Apache-2.0",
    "BSD 3-Clause License": "BSD-3-Clause",
    "BSD License": "BSD",
    "ISC License (ISCL)": "ISC",
    "ISC license": "ISC",
    "MIT License": "MIT",
    "Mozilla Public License 2.0 (MPL 2.0)": "MPL-2.0",
    "Python Software Foundation License": "PSF-2.0",
}


def licence(package: Distribution) -> str:
    """What a package says of its licence, as an SPDX expression where it can be known; empty if nothing.

    Its expression counts; else its licence field, where that is a name and not the whole text; else its classifiers;
    else what was read by hand of this version.
    """
    metadata = package.metadata
    field, name, version = (str((metadata.get_all(key) or [""])[0]).strip() for key in ("License", "Name", "Version"))
    if "License-Expression" in metadata:
        return metadata["License-Expression"]
    if field and field != "UNKNOWN" and "\n" not in field:
        return SPDX.get(field, field)
    classified = [c.split(" :: ")[-1] for c in metadata.get_all("Classifier") or [] if c.startswith("License :: ")]
    if classified:
        return " AND ".join(SPDX.get(name, name) for name in classified)
    read = READ_BY_HAND.get(canonicalize_name(name))
    return read.licence if read is not None and read.version == version else ""


def is_allowed(expression: str, allowed: Collection[str] = frozenset(ALLOWED)) -> bool:
    """Whether an SPDX expression without brackets leaves a choice of licences that are all `allowed`."""
    return all(
        any(re.sub(r" WITH \S+$", "", choice.strip()) in allowed for choice in part.split(" OR "))
        for part in expression.split(" AND ")
    )
