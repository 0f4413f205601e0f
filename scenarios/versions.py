"""Versions of everything that has a part in the numbers of a run."""

from __future__ import annotations

import platform
import subprocess
from contextlib import suppress
from functools import cache
from importlib import metadata
from pathlib import Path

_VERSIONS = ("gridpeers", "eclipse-zenoh", "msgspec", "numpy", "scipy", "numba")


def versions() -> dict[str, str]:
    return {"python": platform.python_version()} | {name: version_of(name) for name in _VERSIONS}


@cache
def version_of(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"


def commit() -> str:
    """Return the short commit of a clone, with "+" if tracked files have changed, or of a wheel's build; else ""."""
    package = Path(__file__).parents[1]
    with suppress(OSError):
        if (package.parent / ".git").exists():
            words = ["git", "-C", str(package.parent), "describe", "--always", "--exclude=*", "--dirty=+"]
            return subprocess.run(words, capture_output=True, text=True, check=False).stdout.strip()
        return (package / "commit.txt").read_text(encoding="utf-8").strip()  # of hatch_build.py
    return ""
