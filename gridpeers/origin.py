"""Are the packages beside this one ours? Their names are common words, and another distribution may have taken one."""

from __future__ import annotations

import sys
from importlib.util import find_spec
from pathlib import Path

PACKAGES = ("wire", "agents", "plant", "netem", "scenarios", "papers")
"""Top-level packages of gridpeers beside this one."""

HOME = Path(__file__).resolve().parents[1]
"""Folder that holds all of them."""


def check_origin(home: Path = HOME) -> None:
    """Check that Python finds our own packages by their names.

    Raises
    ------
    ImportError
        If a name leads to another package, or to none; one line says what to do.
    """
    for name in PACKAGES:
        found = _place_of(name)
        if found == home / name:
            continue
        if found is None:
            text = f'its package "{name}" is missing; install gridpeers again'
        else:
            text = (
                f'Python finds another package "{name}" in {found} than gridpeers\' own in {home}; install gridpeers '
                "into a virtual environment of its own, or rename that folder if it is yours"
            )
        raise ImportError(f"gridpeers cannot be imported: {text}", name=name)


def _place_of(name: str) -> Path | None:
    """Return the folder of a top-level package, or the file of a module; None if there is neither."""
    if name in sys.modules:
        origin = getattr(sys.modules[name], "__file__", None)
    else:
        spec = find_spec(name)
        origin = None if spec is None else spec.origin
    if origin is None:
        return None
    path = Path(origin).resolve()
    return path.parent if path.name == "__init__.py" else path
