"""`gridpeers feeder ...` and `gridpeers init --feeder`, on feeders written for OpenDSS and GridLAB-D."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pandas as pd
import pytest

from gridpeers import Feeder
from tests.command_line import invoke
from tests.unit.bridges.gridlabd.glm_models import HEAD, LOADS

pytest.importorskip("dss", reason="the OpenDSS engine is not installed")
pytest.importorskip("gridlabd", reason="GridLAB-D is not installed")
FEEDERS = Path(__file__).parents[3] / "feeders"


def test_a_script_becomes_an_islanding_that_runs(elsewhere: Path) -> None:
    """After `init --feeder` and `run` the island of the whole feeder is back at 60 Hz, and shares.

    The switch has the line's name everywhere, in events too.
    """
    code, made = invoke("init", "mine", "--feeder", str(FEEDERS / "ieee13.dss"))
    end, ran = invoke(
        "run", "mine/islanding.toml", "--driver", "inprocess", "--case", "ring", "--details", "--out", "out"
    )

    assert code == 0, made
    assert " kW in all, proposed" in made
    assert end == 0, ran
    line = next(line for line in ran.splitlines() if line.startswith("islanding "))
    assert " 0.000 " in line
    assert float(line.split()[-2]) < 2.0
    events = pd.read_csv("out/ring/events.csv")
    assert events[events["kind"] == "switch"][["subject", "text"]].to_numpy().tolist() == [
        ["rg60-632", "switch rg60-632 opened"]
    ]


UNEVEN = """New Circuit.uneven basekv=12.47 pu=1.02 r1=0.1 x1=0.5 r0=0.2 x0=0.9
New Line.sw bus1=sourcebus bus2=a r1=0.02 x1=0.04 r0=0.05 x0=0.12 c1=0 c0=0 length=1
New Line.l1 bus1=a bus2=b r1=0.2 x1=0.4 r0=0.5 x0=1.2 c1=0 c0=0 length=1
New Line.l2 bus1=b bus2=c r1=0.2 x1=0.4 r0=0.5 x0=1.2 c1=0 c0=0 length=1
New Load.a bus1=b.1 phases=1 kv=7.2 kw=900 kvar=400 vminpu=0.7 vlowpu=0.5
New Load.b bus1=b.2 phases=1 kv=7.2 kw=2200 kvar=1000 vminpu=0.7 vlowpu=0.5
New Load.c bus1=c.3 phases=1 kv=7.2 kw=2700 kvar=1200 vminpu=0.7 vlowpu=0.5
Set VoltageBases=[12.47]
CalcVoltageBases
"""
"""A feeder of constant power, most of it on one phase."""


def test_inverters_are_rated_for_the_heaviest_phase(elsewhere: Path) -> None:
    """1.3 times three times the load of phase C, less what lines lose: then an islanding comes to rest at 2 pu."""
    Path("uneven.dss").write_text(UNEVEN)

    code, made = invoke("init", "mine", "--feeder", "uneven.dss", "--switch", "Line.sw")

    assert code == 0, made
    assert "NOTE" not in made
    rated = pd.read_csv("mine/uneven/inverters.csv")["P_rated_kW"].sum()
    assert rated == pytest.approx(1.3 * 3.0 * 2700.0, rel=0.03)


TINY = {
    "tiny.dss": "New Circuit.tiny basekv=0.003 bus1=sourcebus\nNew Load.l bus1=sourcebus kv=0.003 kw=0.001\n",
    "tiny.glm": "module powerflow;\nobject node { name sub; phases ABCN; bustype SWING; nominal_voltage 7.2; }\n",
}
"""Feeders whose voltages are no feeder's."""


@pytest.mark.parametrize("script", TINY)
def test_an_import_that_no_run_could_read_leaves_no_tables(elsewhere: Path, script: str) -> None:
    """Voltage bases that are no feeder's are refused by the script's lines, and the folder is not left behind."""
    Path(script).write_text(TINY[script])

    code, text = invoke("feeder", "import", script, "--out", "mine")

    assert code == 2
    told = [line for line in text.splitlines() if "is not plausible for a nominal voltage" in line]
    assert told
    assert all(re.search(rf"{script}:\d+: (bus |load\.)\S+: V_nom_kV", line) for line in told)
    assert ".csv" not in text
    assert not Path("mine").exists()


NAMED = {
    "named.dss": """New Circuit.named bus1="src bus" basekv=12.47
New "Line.a b" bus1="src bus" bus2="c (1)" r1=0.3 x1=0.5 r0=0.6 x0=1.4 length=2
New Line.l2 bus1="c (1)" bus2="c_(1)" r1=0.3 x1=0.5 r0=0.6 x0=1.4 length=2
New "Load.one load" bus1="c_(1)" kv=12.47 kw=900
Set VoltageBases=[12.47]
CalcVoltageBases
""",
    "named.glm": HEAD.replace(" sub;", ' "src bus";')
    + """object node { name "c (1)"; phases ABCN; nominal_voltage 7200; }
object node { name "c_(1)"; phases ABCN; nominal_voltage 7200; }
object overhead_line { name "a b"; phases ABCN; from "src bus"; to "c (1)"; length 5280; configuration uneven; }
object overhead_line { name l2; phases ABCN; from "c (1)"; to "c_(1)"; length 5280; configuration uneven; }
object load { name "one load"; phases ABCN; parent "c_(1)"; nominal_voltage 7200; constant_power_A 3e5; }
""".replace(" sub;", ' "src bus";'),
}
"""Feeders whose buses have blanks in their names, and one that is called as another would be without them."""


@pytest.mark.parametrize("script", NAMED)
def test_buses_with_blanks_in_their_names_are_imported(elsewhere: Path, script: str) -> None:
    """They have other names in the tables, each its own, which a note tells; switches and loads keep theirs."""
    Path(script).write_text(NAMED[script].replace("from sub", 'from "src bus"'))
    line = "Line.a b" if script.endswith(".dss") else "overhead_line.a b"

    code, text = invoke("feeder", "import", script, "--out", "mine", "--switch", line)

    assert code == 0, text
    assert '"src bus" is src_bus, "c (1)" is c_(1)_2' in text
    feeder = Feeder.read("mine")
    assert {"src_bus", "c_(1)_2", "c_(1)"} < {bus.name for bus in feeder.buses}
    assert [switch.alias for switch in feeder.switches] == ["a b"]
    assert {part.name for part in feeder.load_parts} == {"load.one load"}
    V = feeder.solve().set_index("bus")["V_pu"]
    assert V["src_bus"].min() > V["c_(1)_2"].min() > V["c_(1)"].min() > 0.9


def test_loads_of_another_set_are_other_loads() -> None:
    """A command that reads a folder of tables takes its load set, main if none is named."""
    main, by_name, event2 = (
        invoke("feeder", "check", "microgrid123", *words)[1]
        for words in ((), ("--load-set", "main"), ("--load-set", "event2"))
    )

    assert main == by_name != event2


def test_counts_are_words_for_people(elsewhere: Path) -> None:
    """One switch is no "1 switches"; a node without voltage, and one that is no phase, each say what they are."""
    Path("four.dss").write_text(
        "New Circuit.four basekv=12.47\nNew Line.sw bus1=sourcebus bus2=a length=1 switch=y\n"
        "New Line.l bus1=a.1.2.3.4 bus2=b.1.2.3.4 phases=4 length=1\nNew Reactor.g bus1=b.4 phases=1 r=1 x=0\n"
        "New Load.l bus1=b.1.4 phases=1 kv=7.2 kw=100\n"
    )

    checked, closed = invoke("feeder", "check", "four.dss")[1], invoke("feeder", "solve", "four.dss")[1]
    opened = invoke("feeder", "solve", "four.dss", "--open", "sw")[1]

    assert "~" not in closed
    assert ", 100 kW of load, 1 switch, 0 inverters, 60 Hz" in checked
    assert closed.splitlines()[0] == "15 nodes with voltage; 2 further nodes (neutrals) not counted"
    assert opened.startswith("6 nodes with voltage, 9 without, as the substation does not reach them; 2 further nodes")


def test_a_model_for_gridlabd_goes_the_same_ways(elsewhere: Path) -> None:
    """A .glm file is checked, imported and solved, and becomes an islanding at a line near its substation."""
    Path("feeder.glm").write_text(LOADS)
    for words, text in (
        (("check", "feeder.glm", "--switch", "head"), "switch head: closed; opening it cuts off"),
        (("import", "feeder.glm", "--out", "mine"), "Tables: mine"),
        (("solve", "feeder.glm", "--csv", "model.csv"), "lowest"),
        (("solve", "mine", "--csv", "tables.csv"), "lowest"),
    ):
        code, printed = invoke("feeder", *words)
        assert code == 0, printed
        assert text in printed
    tables, model = (pd.read_csv(f"{name}.csv") for name in ("tables", "model"))
    assert (tables["V_pu"] - model["V_pu"]).abs().max() < 1e-9

    code, made = invoke("init", "mine-islanded", "--feeder", "feeder.glm")

    assert code == 0, made
    assert "overhead_line.head becomes a switch" in made
    assert "switch head islands" in made


@pytest.mark.skipif(sys.platform != "linux", reason="limits the size of files as Linux does")
def test_a_disk_that_fills_up_leaves_nothing_half_written(elsewhere: Path) -> None:
    """A file or folder is there as a whole, or not at all; the error names it."""
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2048, hard))  # a file that grows beyond is refused by the system
    try:
        code, printed = invoke("feeder", "solve", "microgrid123", "--csv", "v.csv")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))

    assert code == 2
    assert "v.csv: cannot be written: File too large" in printed
    assert list(Path().iterdir()) == []
