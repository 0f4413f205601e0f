"""An agent runs what only the plant names if the plant is near, or trusted."""

from __future__ import annotations

from contextlib import nullcontext

import pytest
from msgspec.structs import replace

from gridpeers.agents.agent_config import Control, LawChoice
from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem
from gridpeers.scenarios.emulation.emulation_config import EmulationConfig
from gridpeers.scenarios.live import live_processes
from gridpeers.scenarios.live.run_address import RunAddress, UsageError
from gridpeers.scenarios.live.run_requests import own_code
from gridpeers.wire.plugins.plugin import Plugin
from tests.toy.toy_configs import agent_config

SETUP = EmulationConfig(
    netem=Netem(links=(Fault(on="* -> *", own=(Plugin(use="mine:Jammer"),)),)), microgrids={"inv1": "MG1"}
)
CONTROL = Control(secondary="all", graph="mine:star", own_graph=Plugin(use="mine:star"), law=LawChoice(use="mine:Mine"))
CONFIG = replace(agent_config("inv1"), control=CONTROL, links=SETUP.to_tree())


def test_what_is_not_gridpeers_own_is_named() -> None:
    """Law, graph and faults by module:Name; what is registered or installed is on this host anyway."""
    calm = replace(CONTROL, own_graph=None, law=LawChoice(use="dapi"))

    assert own_code(CONFIG) == ("the law mine:Mine", "the graph mine:star", "the link fault mine:Jammer")
    assert own_code(replace(CONFIG, control=calm, links={})) == ()


@pytest.mark.parametrize(("endpoint", "trusts", "runs"), [
    ("tcp/127.0.0.1:7447", False, True),
    ("tcp/192.168.1.10:7447", False, False),
    ("tcp/192.168.1.10:7447", True, True),
])  # fmt: skip
def test_code_of_a_plant_on_another_host_is_run_only_if_it_is_trusted(
    endpoint: str, trusts: bool, runs: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever can pose as a plant would else have any program run on every host that joins."""
    ran: list[str] = []
    where = RunAddress(run="demo", connect=(endpoint,))
    monkeypatch.setattr(
        live_processes, "RunClient", lambda where: nullcontext(type("V", (), {"find_plant": lambda *_: None})())
    )
    monkeypatch.setattr(live_processes, "configuration", lambda client, name, wait: CONFIG)
    monkeypatch.setattr(live_processes, "check_free", lambda client, name: None)
    monkeypatch.setattr(
        live_processes, "run_agents", lambda process, links: ran.extend(config.name for config in process) or ""
    )
    monkeypatch.setattr(live_processes, "stop_at_signals", lambda *_: None)

    if runs:
        live_processes.agent_here(where, ("inv1",), None, 1.0, trusts=trusts)
    else:
        with pytest.raises(UsageError, match=r"inv1: the plant of run demo .* run the law mine:Mine and .*--own-code"):
            live_processes.agent_here(where, ("inv1",), None, 1.0, trusts=trusts)
    assert ran == (["inv1"] if runs else [])
