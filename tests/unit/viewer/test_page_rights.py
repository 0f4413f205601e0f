from __future__ import annotations

from pathlib import Path

import pytest

from gridpeers.viewer.live_pages import looks_only
from gridpeers.wire.trust.key_folder import open_credentials
from gridpeers.wire.trust.site_authority import make_site

pytest.importorskip("cryptography", reason="certificates need the extra keys")


def test_a_page_that_only_looks_names_what_would_let_the_same_person_act(elsewhere: Path) -> None:
    """An operator needs --control; a viewer another certificate, by name if its key is in the folder."""
    make_site(Path("lab"))
    operator = open_credentials(Path("lab"), ("operator",))[0]
    viewer = open_credentials(Path("lab"), ("viewer",))[0]
    said = "the page only looks, as viewer has the role viewer "

    assert looks_only(operator) == "the page only looks (--control lets it act)"
    assert looks_only(viewer) == f"{said}(--as operator --control lets it act)"
    (elsewhere / "lab" / "operator.key").unlink()
    assert looks_only(viewer) == f"{said}(to act takes --control and the key of an operator)"
