"""Every room has one name, so that no module is loaded twice."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import pytest

import gridpeers as gp

ROOMS = sorted(link.name for link in Path(gp.__file__).parent.iterdir() if link.is_symlink())


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_cannot_be_imported_by_the_name_of_its_folder(room: str) -> None:
    """The folder is found where the repository's root is on the path, as it is for the tests; its import is refused."""
    with pytest.raises(ImportError, match=f"import gridpeers.{room}"):
        import_module(room)
