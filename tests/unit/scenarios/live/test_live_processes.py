"""What a live run's terminal shows and refuses."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar, cast

import msgspec
import pytest
from msgspec.structs import replace

from gridpeers.agents.agent_config import Control, LawChoice
from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem
from gridpeers.plant.known_names import COMPILING, LISTENING
from gridpeers.scenarios import measured_run
from gridpeers.scenarios.emulation.link_data import EmulationConfig
from gridpeers.scenarios.live import live_processes
from gridpeers.scenarios.live.live_files import folders
from gridpeers.scenarios.live.live_processes import UNHEARD, LiveRecorder, ProcessOutcome, _followed, meaning
from gridpeers.scenarios.live.run_address import RunAddress, UsageError
from gridpeers.scenarios.live.run_requests import own_code
from gridpeers.scenarios.results.record import Recorded
from gridpeers.scenarios.run_request import Request
from gridpeers.scenarios.schema import load_scenario
from gridpeers.wire.plugins.plugin import Plugin
from tests.toy.toy_configs import agent_config, toy_configs


def test_a_refused_handshake_is_told_without_the_words_of_zenoh() -> None:
    """Its reason stays; colours of a terminal, thread and hint go."""
    config, _ = toy_configs(2)
    line = (
        "\x1b[2m2026-11-23T09:08:43.534631Z\x1b[0m \x1b[33m WARN\x1b[0m app-0 ThreadId(02) "
        "\x1b[2mzenoh_link_tls::unicast\x1b[0m\x1b[2m:\x1b[0m peer sent no certificates. "
        "Hint: increase the system open file limit."
    )

    assert meaning(line, config) == "a link was refused: peer sent no certificates"
    assert meaning(LISTENING, config) == ""
    assert "is being built" in meaning(COMPILING, config)


SETUP = EmulationConfig(
    netem=Netem(links=(Fault(on="* -> *", own=(Plugin(use="mine:Jammer"),)),)), microgrids={"inv1": "MG1"}
)
CONTROL = Control(secondary="all", graph="mine:star", own_graph=Plugin(use="mine:star"), law=LawChoice(use="mine:Mine"))
CONFIG = replace(agent_config("inv1"), control=CONTROL, links=SETUP.to_tree())


def test_what_is_not_gridpeers_own_is_named() -> None:
    """Law, graph and faults by module:Name; what is registered or installed is on this host anyway."""
    calm = replace(CONTROL, own_graph=None, law=LawChoice(use="dapi"))

    assert tuple(own_code(CONFIG)) == ("the law mine:Mine", "the graph mine:star", "the link fault mine:Jammer")
    assert tuple(own_code(replace(CONFIG, control=calm, links={}))) == ()


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
    monkeypatch.setattr(live_processes, "free_configurations", lambda client, names, wait: [CONFIG])
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


def test_a_run_of_which_nothing_was_heard_has_failed() -> None:
    """Its plant ended well by its own account: no link to it was made, so nobody knows what it did."""

    class DeafRecorder:
        """A recorder to which nothing came."""

        failure, recorded, client = "", None, SimpleNamespace(pacing=None, latest=None)
        failed_laws: ClassVar[dict[str, object]] = {}

        def __enter__(self) -> DeafRecorder:
            return self

        def __exit__(self, *_: object) -> None:
            """End as a recorder that writes no files."""

    outcome = _followed(cast("LiveRecorder", DeafRecorder()), lambda: "")

    assert outcome.broke == UNHEARD


def test_a_run_that_is_interrupted_while_it_is_judged_has_its_scenario(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its numbers are missing; the scenario that it began with can be run again."""

    def interrupted(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(measured_run, "write_measures", interrupted)
    scenario, _ = load_scenario("islanding")
    scenario = msgspec.structs.replace(scenario, cases={"IV": scenario.cases["IV"]})
    outcome = ProcessOutcome(recorded=cast(Recorded, SimpleNamespace(ended=2.01)))
    with folders(tmp_path / "live", scenario) as kept:
        assert kept.whole == tmp_path / "live"
        ended = live_processes.conclude(outcome, cast(Request, SimpleNamespace(scenario=scenario, folder=kept.whole)))

    assert load_scenario(tmp_path / "live" / "scenario.toml")[0] == scenario
    assert ended.interrupted == "SIGINT"
    assert (tmp_path / "live" / "status.txt").read_text() == "broken: interrupted while its numbers were made\n"
