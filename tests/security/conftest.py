from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.toy.town import Town

THREE = ("inv1", "inv2", "inv3")


@pytest.fixture(scope="session")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("cryptography", reason="certificates need the extra keys")
    from gridpeers.wire.trust.site_authority import issue, make_site, revoke

    folder = tmp_path_factory.mktemp("sites") / "lab"
    make_site(folder)
    for name in THREE:
        issue(folder, name)
    issue(folder, "eve", "operator")
    shutil.copytree(folder, folder.parent / "before")  # what eve has kept
    revoke(folder, "eve")
    return folder


@pytest.fixture(scope="module")
def town(lab: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Town]:
    folder = tmp_path_factory.mktemp("town")
    with Town(3, folder, keys_folder=lab, spares=("inv3",)).all() as made:
        yield made
