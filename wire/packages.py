"""Words for a package that is missing, or installed and does not load."""

from __future__ import annotations

import linecache
import re
from collections import Counter
from importlib.util import find_spec
from traceback import walk_tb

DISTRIBUTIONS = {
    "dss": "dss-python dss-python-backend",
    "py_dss_interface": "py-dss-interface",
    "zenoh": "eclipse-zenoh",
}
"""What pip calls a package, where it has another name there."""

_OWN = ("gridpeers",)


def damaged(module: str, reason: str, user: str) -> str:
    """Return one line on a package that is installed, and cannot be imported for a reason.

    Examples
    --------
    >>> damaged("dss", "OSError: no libdss.so", "the import")
    'dss is installed, but cannot be imported (OSError: no libdss.so); the import needs it: pip install \
--force-reinstall dss-python dss-python-backend'
    """
    again = f"pip install --force-reinstall {DISTRIBUTIONS.get(module, module)}"
    return f"{module} is installed, but cannot be imported ({' '.join(reason.split())}); {user} needs it: {again}"


def not_importable(error: ImportError) -> str:
    """Return one line on the package that an import of ours did not find or could not load, and what to install."""
    module = _module_of(error)
    if not module:
        return f"a package cannot be imported ({error})"
    try:
        missing = find_spec(module) is None
    except (ImportError, ValueError):
        missing = True
    if not missing:
        return damaged(module, f"{type(error).__name__}: {error}", "gridpeers")
    package = DISTRIBUTIONS.get(module, module)
    return f"{package} is not installed; gridpeers needs it: pip install {requirement(module)}"


def requirement(module: str) -> str:
    """Return what pip is to install for a package: its version of ours, or the extra of gridpeers that has it.

    Examples
    --------
    >>> requirement("zenoh").startswith("'eclipse-zenoh"), requirement("pyarrow"), requirement("torch")
    (True, "'gridpeers[sweep]'", 'torch')
    """
    from importlib import metadata  # it brings a mail reader; starts need none of this

    package = DISTRIBUTIONS.get(module, module)
    try:
        required = metadata.requires("gridpeers") or []
    except metadata.PackageNotFoundError:  # run from its sources
        required = []
    found = [
        (re.split(r"[\[<>=~! ]", name)[0].lower(), name.strip(), re.search(r"extra == [\"']([\w-]+)", marker))
        for name, _, marker in (text.partition(";") for text in required)
    ]
    ours = [(spec, extra) for name, spec, extra in found if name == package.partition(" ")[0].lower()]
    if not ours:
        return package
    if core := next((spec for spec, extra in ours if not extra), ""):
        return f"'{core}'"
    sizes = Counter(extra[1] for _, _, extra in found if extra)
    return f"'gridpeers[{min((extra[1] for _, extra in ours if extra), key=lambda name: sizes[name])}]'"


def _module_of(error: ImportError) -> str:
    """Return the package that an import failed for, "" if that cannot be known."""
    module = ""
    for frame, line in walk_tb(error.__traceback__):
        root = str(frame.f_globals.get("__name__", "")).partition(".")[0]
        if root in _OWN:
            statement = re.match(r"\s*(?:from|import)\s+(\w+)", linecache.getline(frame.f_code.co_filename, line))
            module = statement[1] if statement and statement[1] not in _OWN else ""
        elif not module and root not in ("importlib", "runpy", "__main__"):
            module = root
    return module or (error.name or "").partition(".")[0]
