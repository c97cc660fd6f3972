"""Ray's private names that metaid needs: what keeps Ray to loopback.  pyproject.toml caps Ray's version for them.

Elsewhere Ray listens on every interface of the machine, and runs what anybody sends it. The one public option
against this is read when Ray is imported, which may be long before metaid starts it.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

from metaid.errors import StudyError


@contextmanager
def ray_on_loopback() -> Iterator[None]:
    """Within it Ray starts on loopback, by the option that keeps it from clusters: where a firewall would ask, Ray
    takes it by itself.  Raises StudyError where this version of Ray lacks it, rather than open ports.
    """
    import ray
    from ray._private import ray_constants

    try:
        name, before = ray_constants.ENABLE_RAY_CLUSTERS_ENV_VAR, ray_constants.ENABLE_RAY_CLUSTER
    except AttributeError as problem:
        raise StudyError(
            f"Ray {ray.__version__} cannot be kept to loopback ({problem}): install a version that metaid allows"
        ) from None
    previous = os.environ.get(name)
    os.environ[name], ray_constants.ENABLE_RAY_CLUSTER = "0", False  # for Ray's processes, and for this one
    try:
        yield
    finally:
        ray_constants.ENABLE_RAY_CLUSTER = before
        if previous is None:
            os.environ.pop(name)
        else:
            os.environ[name] = previous
