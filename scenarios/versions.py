"""Versions of everything that has a part in the numbers of a run."""

from __future__ import annotations

import platform
from functools import cache
from importlib import metadata

_VERSIONS = ("gridpeers", "eclipse-zenoh", "msgspec", "numpy", "scipy", "numba")


def versions() -> dict[str, str]:
    return {"python": platform.python_version()} | {name: version_of(name) for name in _VERSIONS}


@cache
def version_of(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"
