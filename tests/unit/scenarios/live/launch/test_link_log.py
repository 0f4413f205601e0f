"""The scenario that replays the link commands of a live run."""

from __future__ import annotations

from pathlib import Path

from agents.agent_config import MAX_AGE
from netem.schema.change import Heal, schedule_of
from netem.schema.fault import Fault
from netem.schema.pattern import Link, links_among
from scenarios.emulation.link_command import LinkCommand
from scenarios.live.launch.link_log import replay_of
from scenarios.schema import load_scenario
from scenarios.schema.netem_tables import netem_of, setup_of
from scenarios.schema.scenario_writing import to_toml


def test_the_replayed_scenario_is_one_and_its_links_do_what_was_commanded(tmp_path: Path) -> None:
    """Written and read again, every link has at every time what scenario and commands gave it."""
    text = (
        "[time]\nend_s = 2.0\n[case.IV]\nsecondary = 'all'\ngraph = 'full'\n"
        "[[case.IV.link]]\non = 'MG1 -> MG2'\ndelay = 0.1\n[[partition]]\nalone = 'inv5'\nfrom_s = 1.0\nto_s = 1.5\n"
    )
    (tmp_path / "mine.toml").write_text(text)
    scenario, feeder = load_scenario(tmp_path / "mine.toml")
    setup = setup_of(netem_of(scenario, "IV"), scenario, feeder, real_nodes=True)
    changes = [
        LinkCommand(fault=Fault(on="* -> inv4", profile="lte", delay=0.3), for_s=1.0).at(0.62),
        LinkCommand(fault=Fault(on="inv4 <-> plant", cut=True)).at(1.2),
        LinkCommand(heal=Heal(on="inv1 -> inv4", from_s=0.0)).at(1.4),
        LinkCommand(fault=Fault(on="inv7 -> inv8", loss=0.5)).at(7.34),
    ]
    (tmp_path / "again.toml").write_text(to_toml(replay_of(scenario, feeder, changes, 7.33), {}))
    again, _ = load_scenario(tmp_path / "again.toml")
    netem = netem_of(again, "IV")

    assert (again.name, again.time.end_s) == ("again", 7.36)
    assert again.cases["IV"].degraded_communication.max_age == MAX_AGE, "which only wall-clock time has by default"
    for link in links_among([name for name in setup.microgrids if name != "inv10"]):
        live = schedule_of(link, setup.netem, changes, setup.microgrids)
        planned = schedule_of(Link(*link), netem, (), setup.microgrids)
        for t in (0.0, 0.6, 0.62, 1.1, 1.3, 1.45, 1.6, 1.62, 7.32, 7.34, 7.5):
            was, is_now = ({k: s.model for k, s in one.at(t).active.items()} for one in (live, planned))
            gates = [{"cut" if kind == "partition" else kind for kind in found} for found in (was, is_now)]
            assert gates[0] == gates[1], (link, t)
            assert {k: m for k, m in was.items() if k in ("delay", "loss")} == {
                k: m for k, m in is_now.items() if k in ("delay", "loss")
            }
