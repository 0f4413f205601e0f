"""Where another process finds the module of a reference."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from gridpeers.wire.plugins.registry import NOTEBOOK, is_of_another
from gridpeers.wire.wording import is_no_path


def folder_of(reference: str, folder: str) -> str:
    """Return where another process finds the module of a reference: `folder` if it is there, else its own folder.

    Examples
    --------
    >>> folder_of("gridpeers.wire.plugins.registry:Registry", "here") == str(Path(__file__).parents[3])
    True
    >>> folder_of("nowhere:Mine", "here")
    'here'
    """
    top = reference.partition(":")[0].partition(".")[0]
    if is_no_path(folder) or is_no_path(f"{top}.py"):  # a problem, which the check of the key notes
        return folder
    beside = Path(folder)
    if (beside / f"{top}.py").is_file() or (beside / top).is_dir() or top == NOTEBOOK:
        return folder
    try:
        spec = find_spec(top)
    except ValueError:  # a module without a specification, as of an embedded interpreter
        return folder
    if spec is None or spec.origin is None or spec.origin == "frozen" or is_of_another(spec, folder):
        return folder
    place = Path(spec.origin).resolve().parent
    return str(place.parent if spec.submodule_search_locations else place)
