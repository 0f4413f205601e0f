"""Errors of a live run that name a command: as typed, it reaches the run that they speak of."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from gridpeers.scenarios.live import run_requests
from gridpeers.scenarios.live.run_address import RUN, Access, RunAddress
from gridpeers.scenarios.live.run_client import NobodyError


@pytest.mark.parametrize(
    ("where", "typed"),
    [
        (RunAddress(run=RUN, connect=("tcp/127.0.0.1:7447",)), "gridpeers stop inv2"),
        (
            RunAddress(run="lab", connect=("tls/10.0.0.1:7447",), access=Access(keys=Path("site"))),
            "gridpeers stop inv2 --run lab --connect tls/10.0.0.1:7447 --keys site",
        ),
    ],
)
def test_the_other_agent_of_a_name_is_stopped_where_it_is(
    where: RunAddress, typed: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`gridpeers stop inv2` alone would stop an agent of the default run, or find no plant."""
    monkeypatch.setattr(run_requests, "plant_status", lambda client: SimpleNamespace(agents=("inv2",)))

    with pytest.raises(NobodyError) as error:
        run_requests.check_free(SimpleNamespace(where=where), "inv2")  # type: ignore[arg-type]

    assert f"({typed})" in str(error.value)
