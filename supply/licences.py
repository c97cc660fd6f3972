"""The licence of each dependency, as pip-licenses reads it, and whether metaid may be used with it by anyone."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from packaging.utils import canonicalize_name

# As packages state them, each combination as it stands. Permissive ones; and those that ask only for changes of their
# own files (MPL), or for being replaceable (LGPL), of what is imported as it is. `any-OSI` is each that the OSI
# approves, at one's choice, beside the Zlib text that apsw ships.
ALLOWED = {
    *("Apache-2.0", "BSD-2-Clause", "BSD-3-Clause", "BSL-1.0", "ISC", "MIT", "MIT-CMU"),
    *("PSF-2.0", "Qhull", "Zlib", "MPL-2.0", "LGPL-3.0-only", "any-OSI"),
    *("3-Clause BSD License", "Apache 2.0", "Apache Software License", "BSD", "BSD License", "ISC License (ISCL)"),
    *("MIT License", "Mozilla Public License 2.0 (MPL 2.0)", "Python Software Foundation License"),
    *("Apache-2.0 OR BSD-2-Clause", "Apache Software License; MIT License", "MIT OR Apache-2.0", "MPL-2.0 AND MIT"),
    *("BSD-2-Clause AND Apache-2.0 WITH LLVM-exception", "BSD-3-Clause AND 0BSD AND MIT AND Zlib AND CC0-1.0"),
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


def licences(python: Path | str, pip_licenses: Sequence[str]) -> dict[str, str]:
    """The licence of every package that this `python` can import, by canonical name; where its metadata state none,
    what was read by hand of this version, or UNKNOWN.
    """
    asked = [*pip_licenses, "--with-system", "--format=json", "--from=mixed", f"--python={python}"]
    try:
        told = json.loads(subprocess.run(asked, stdout=subprocess.PIPE, check=True).stdout)
    except OSError:
        raise SystemExit(f"{asked[0]} is not there: make audit") from None
    found: dict[str, str] = {}
    for package in told:
        name, version, licence = canonicalize_name(package["Name"]), package["Version"], package["License"]
        read = READ_BY_HAND.get(name)
        found[name] = read.licence if licence == "UNKNOWN" and read and read.version == version else licence
    return found


def refused(names: Iterable[str], stated: Mapping[str, str], allowed: Collection[str] = ALLOWED) -> dict[str, str]:
    """Those of the packages whose licence, as `stated`, is not allowed, with it."""
    return {name: stated.get(name, "UNKNOWN") for name in names if stated.get(name) not in allowed}
