"""Agents that join and leave a run with certificates."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from msgspec.structs import replace

from gridpeers.wire.trust.key_folder import open_credentials
from gridpeers.wire.trust.site_authority import issue, make_site
from tests.toy.town import Town

pytest.importorskip("cryptography", reason="certificates need the extra keys")


def test_an_agent_whose_certificate_is_issued_later_joins_the_run(tmp_path: Path) -> None:
    """The others began with a list that does not have it; they use its values, and it theirs."""
    lab = tmp_path / "lab"
    make_site(lab)
    for name in ("inv1", "inv2"):
        issue(lab, name)
    with Town(3, tmp_path, keys_folder=lab, spares=("inv3",)).all() as town:
        host = tmp_path / "host"
        host.mkdir()
        issue(lab, "inv3")
        for file in ("ca.pem", "members.json", "inv3.pem", "inv3.key"):
            shutil.copy2(lab / file, host)
        credentials, _ = open_credentials(host, ("agent",), "inv3")

        town.add("inv3", ["-m", "gridpeers.agents"], replace(town.agent_configs["inv3"], credentials=credentials))

        town.together(("inv1", "inv2", "inv3"))
        assert town.session.vouches("inv3")
