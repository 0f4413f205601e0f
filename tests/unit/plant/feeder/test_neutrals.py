"""Inverters that return to a neutral conductor: terminals, islands and their earth, beside the OpenDSS engine."""

from __future__ import annotations

from cmath import phase as phase_of
from math import degrees
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import gridpeers as gp
from gridpeers.plant.dynamics import Dynamics
from gridpeers.plant.feeder import Plant
from gridpeers.plant.feeder.circuits import circuit_of
from gridpeers.plant.feeder.plant import installed_inverters
from gridpeers.plant.inverters.gfl import Gfl
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings, SwitchEvent
from tests.unit.bridges.opendss.opendss_solutions import LETTERS, TOLERANCE

pytest.importorskip("dss", reason="the import of .dss files needs the extra opendss")

SOURCE = """Clear
Set DefaultBaseFrequency=50
New Circuit.lv bus1=mv basekv=15 pu=1.0 MVAsc3=150 MVAsc1=140
New Transformer.tr phases=3 windings=2 xhl=4 %loadloss=1.2
~ wdg=1 bus=mv conn=delta kv=15 kva=160
~ wdg=2 bus=b0.1.2.3.4 conn=wye kv=0.4 kva=160
New LineCode.alu4 nphases=4 units=km
~ rmatrix=[0.45 | 0.05 0.45 | 0.05 0.05 0.45 | 0.05 0.05 0.05 0.62]
~ xmatrix=[0.36 | 0.28 0.36 | 0.28 0.28 0.36 | 0.28 0.28 0.28 0.36]
~ cmatrix=[0 | 0 0 | 0 0 0 | 0 0 0 0]
"""

STREET = """New Line.a1 phases=4 bus1=b0.1.2.3.4 bus2=b1.1.2.3.{n} linecode=alu4 length=180 units=m
New Line.a2 phases=4 bus1=b1.1.2.3.{n} bus2=b2.1.2.3.{n} linecode=alu4 length=150 units=m
New Line.a3 phases=2 bus1=b2.1.{n} bus2=b3.1.{n} r1=0.6 x1=0.3 r0=0.6 x0=0.3 c1=0 c0=0 length=0.06 units=km
New Load.p1 phases=1 bus1=b1.2.{n} kv=0.23 kw=7 pf=0.95
New Load.p2 phases=1 bus1=b2.1.{n} kv=0.23 kw=9 pf=0.95
New Load.p3 phases=1 bus1=b3.1.{n} kv=0.23 kw=3 pf=1
New Load.m1 phases=3 bus1=b2.1.2.3.{n} kv=0.4 kw=6 pf=0.85
"""

EARTH = "New Reactor.{0} phases=1 bus1={1} bus2={2}.0 R={3} X=0\n"

AT_TRANSFORMER = EARTH.format("earth", "b0.4", "b0", 2)

KINDS = {
    "earthed at the transformer": STREET.format(n=4) + AT_TRANSFORMER,
    "earthed well at the transformer": STREET.format(n=4) + EARTH.format("earth", "b0.4", "b0", 1e-5),
    "earthed at every house": STREET.format(n=4)
    + AT_TRANSFORMER
    + "".join(EARTH.format(f"e{bus}", f"b{bus}.4", f"b{bus}", 20) for bus in (1, 2, 3)),
    "another number": STREET.format(n=9) + AT_TRANSFORMER,
    "loads to ground beside": STREET.format(n=4)
    + AT_TRANSFORMER
    + "New Load.g phases=1 bus1=b2.3 kv=0.23 kw=1 pf=0.9\nNew Load.d phases=1 bus1=b2.2.3 kv=0.4 kw=2 pf=1\n"
    + "New Load.g2 phases=1 bus1=b3.1 kv=0.23 kw=1.2 pf=1 model=5\n",
    "two neutrals at a bus": STREET.format(n=4)
    + AT_TRANSFORMER
    + "New Reactor.n5 phases=1 bus1=b2.4 bus2=b2.5 R=0.3 X=0\nNew Load.n5 phases=1 bus1=b2.1.5 kv=0.23 kw=1.5 pf=1\n",
}
"""Streets of four wires, and how their neutral is earthed."""


def imported(folder: Path, street: str) -> tuple[gp.Feeder, str]:
    script = SOURCE + street + "Set VoltageBases=[15 0.4]\nCalcVoltageBases\nSolve\n"
    (folder / "Master.dss").write_text(script)
    return gp.Feeder.read(folder / "Master.dss", switches=["Line.a1"]), script


def engine(script: str, *commands: str) -> dict[str, complex]:
    """Voltage (V) of each node, "b1.4", that the engine gives a script with these commands after it."""
    from dss import DSS

    context: Any = DSS.NewContext()
    context.AllowForms = context.AllowEditor = False
    for line in (*script.splitlines(), *commands, "set tolerance=1e-12", "set maxiterations=1000", "solve"):
        if line:
            context.Text.Command = line
    circuit = context.ActiveCircuit
    assert circuit.Solution.Converged
    pairs = np.asarray(circuit.YNodeVarray, float).reshape(-1, 2)
    return {str(name).lower(): complex(*pair) for name, pair in zip(circuit.YNodeOrder, pairs, strict=True)}


def started(feeder: gp.Feeder, closed: frozenset[str], P: float) -> tuple[Network, Dynamics]:
    """The feeder's inverters at rest, each with this part of its rating."""
    network, settings = Network(feeder), PlantSettings(gfl=Gfl(P_min=0.0))
    dynamics = Dynamics(circuit_of(network, closed, network.loads()), installed_inverters(network, settings), 1e-3)
    n = len(feeder.inverters)
    dynamics.start(np.full(n, P), V_set=np.full(n, 1.0))
    return network, dynamics


def cut_off(feeder: gp.Feeder, steps: int) -> tuple[Network, Dynamics]:
    """The feeder's inverters, which begin without power, these steps of 1 ms after switch a1 has opened."""
    network, dynamics = started(feeder, frozenset({Network(feeder).switch_name("a1")}), 0.0)
    dynamics.connect(circuit_of(network, frozenset(), network.loads()))
    dynamics.run(steps)
    return network, dynamics


def in_engine(network: Network, dynamics: Dynamics, *, behind_filter: bool) -> list[str]:
    """The inverters as the engine has them: GFM as voltages behind their filters, if so; others as constant powers."""
    units, commands = dynamics.inverters, []
    for i, row in enumerate(network.inverters):
        n = LETTERS.index(row.neutral) + 1 if row.neutral else 0
        for k, phase in enumerate(row.phases):
            ends = f"bus1={row.bus}.{'ABC'.index(phase) + 1}.{n}"
            if behind_filter and row.kind == "GFM":
                E, z = complex(units.J[i, k] / units.y_f[i]), complex(1.0 / units.y_f[i])
                ends = f"bus1={row.bus}.{'ABC'.index(phase) + 1} bus2={row.bus}.{n}"
                commands.append(
                    f"New Vsource.{row.name}{phase} phases=1 {ends} basekv={abs(E) / 1e3!r} pu=1 "
                    f"angle={degrees(phase_of(E))!r} R1={z.real!r} X1={z.imag!r} R0={z.real!r} X0={z.imag!r}"
                )
                continue
            S = complex(units.V[i, k] * np.conj(units.I[i, k])) / 1e3
            commands.append(
                f"New Generator.{row.name}{phase} phases=1 {ends} kv={row.V_nom / 1e3!r} kw={S.real!r} "
                f"kvar={S.imag!r} model=1 vminpu=0.1 vmaxpu=3"
            )
    return commands


def largest_difference(
    network: Network, dynamics: Dynamics, closed: frozenset[str], theirs: dict[str, complex], without: str = ""
) -> float:
    """Largest difference between the engine's voltages and ours (pu) over the nodes of all buses but some."""
    ours = network.merge(closed).expand(dynamics.voltages())
    compared = [
        abs(theirs[f"{bus}.{LETTERS.index(phase) + 1}"] - V) / V_nom
        for (bus, phase), V, V_nom in zip(network.nodes, ours, network.V_nom, strict=True)
        if "~" not in bus and bus not in without.split()
    ]
    assert len(compared) > 8
    return max(compared)


def with_followers(feeder: gp.Feeder) -> gp.Feeder:
    """The feeder with followers of one phase and of three at its houses."""
    return feeder.add_inverter("roof", "b3", "GFL", 5e3, phases="A").add_inverter("hall", "b2", "GFL", 2e4)


@pytest.mark.parametrize("kind", KINDS)
def test_with_the_grid_voltages_are_the_engines(tmp_path: Path, kind: str) -> None:
    """Inverters of one and three phases return to the neutral of their bus: every node has the engine's voltage."""
    feeder, script = imported(tmp_path, KINDS[kind])
    network, dynamics = started(with_roofs(feeder), Network(feeder).closed0, 0.4)

    theirs = engine(script, *in_engine(network, dynamics, behind_filter=False))

    assert largest_difference(network, dynamics, network.closed0, theirs) < TOLERANCE


@pytest.mark.parametrize("kind", KINDS)
def test_an_island_has_the_voltages_that_the_engine_gives_behind_the_same_filters(tmp_path: Path, kind: str) -> None:
    """An island's star point is on its neutral; where nothing else earths that, the grid-forming inverter does."""
    feeder, script = imported(tmp_path, KINDS[kind])
    network, dynamics = started(with_roofs(feeder), frozenset(), 0.4)

    earth = [] if "house" in kind else [EARTH.format("k", f"b1.{9 if 'number' in kind else 4}", "b1", 1e-3).strip()]
    theirs = engine(script, *in_engine(network, dynamics, behind_filter=True), *earth, "open line.a1 1")

    assert largest_difference(network, dynamics, frozenset(), theirs, "mv b0") < TOLERANCE


def with_roofs(feeder: gp.Feeder) -> gp.Feeder:
    """The feeder with a leader at its first house, and followers."""
    return with_followers(feeder.add_inverter("street", "b1", "GFM", 3e4))


def events_of(feeder: gp.Feeder, until: float, P: float = 0.4, **gfl: Any) -> tuple[Plant, list[str]]:
    """The plant after its street is cut off at 0.1 s, and the texts of its events."""
    settings = PlantSettings(P_set0=P, gfl=Gfl(**gfl), events=(SwitchEvent(t=0.1, switch="a1", action="open"),))
    plant = Plant(Network(feeder), settings, 0.02, 0.02)
    while plant.tick * 0.02 < until:
        plant.advance()
    return plant, [event.text for event in plant.take_events()]


def test_a_street_that_is_cut_off_keeps_its_loads_and_its_star_point_is_earthed(tmp_path: Path) -> None:
    """An island without the earth of its transformer serves its 25 kW at healthy voltages, and says who earths it."""
    feeder, _ = imported(tmp_path, KINDS["earthed at the transformer"])
    feeder = feeder.add_inverter("bat", "b1", "GFM", 6e4)
    feeder = feeder.add_inverter("pv", "b2", "GFL", 3e4)
    plant, told = events_of(feeder, 3.0, P=0.2, P_min=0.0, volt_var=False)
    now = plant.measure()

    assert [text for text in told if "earth" in text] == ["bat earths its neutral, node 4 of bus b1: nothing else does"]
    assert 25.0e3 < now["bat"].P + now["pv"].P < 25.5e3
    assert all(226.0 < reading.V < 232.0 for reading in now.values())


@pytest.mark.parametrize(("kind", "begins"), [
    ("earthed at the transformer", "cut off"),
    ("loads to ground beside", "an island"),
    ("two neutrals at a bus", "with followers"),
])  # fmt: skip
def test_a_neutral_that_nothing_earths_has_the_voltage_that_the_engine_gives(
    tmp_path: Path, kind: str, begins: str
) -> None:
    """Where loads alone hold a neutral, it has the voltage to earth of one that is insulated with 1 megohm."""
    feeder, script = imported(tmp_path, KINDS[kind])
    feeder = feeder.add_inverter("bat", "b1", "GFM", 6e4, neutral="earth")
    if begins == "with followers":
        feeder = with_followers(feeder)
    network, dynamics = cut_off(feeder, 100) if begins == "cut off" else started(feeder, frozenset(), 0.2)

    commands = in_engine(network, dynamics, behind_filter=True)
    theirs = engine(script, *commands, EARTH.format("k", "b1.4", "b1", 1e6).strip(), "open line.a1 1")

    assert abs(theirs["b2.4"]) > 50.0
    assert largest_difference(network, dynamics, frozenset(), theirs, "mv b0") < TOLERANCE


def test_an_inverter_returns_to_the_neutral_of_its_bus_unless_told(tmp_path: Path) -> None:
    """The default is the neutral to which loads return, here or along its conductor; node and earth replace it."""
    feeder, _ = imported(tmp_path, KINDS["two neutrals at a bus"])
    added = {
        "b0": feeder.add_inverter("x", "b0", "GFL", 2e4),  # no load stands there
        "mv": feeder.add_inverter("x", "mv", "GFL", 2e4),
        "number": feeder.add_inverter("x", "b2", "GFL", 2e4, neutral=5),
        "letter": feeder.add_inverter("x", "b2", "GFL", 2e4, neutral="5"),
        "earth": feeder.add_inverter("x", "b2", "GFL", 2e4, neutral="earth"),
    }

    assert {key: of.inverters[0].neutral for key, of in added.items()} == {
        "b0": "4",
        "mv": "",
        "number": "5",
        "letter": "5",
        "earth": "",
    }
    for of in added.values():
        assert gp.Feeder.read(of.save(tmp_path / "saved")).inverters == of.inverters
    with pytest.raises(ValueError, match='neutral "B": bus "b2" has no such neutral; possible: 4, 5, earth'):
        feeder.add_inverter("x", "b2", "GFL", 5e3, phases="A", neutral="B")


def test_solved_voltages_of_phases_count_from_the_neutral(tmp_path: Path) -> None:
    """Voltages of a feeder are those between phase and neutral where there is one, and say so."""
    feeder, script = imported(tmp_path, KINDS["earthed at the transformer"])
    theirs, table = engine(script), feeder.solve().set_index(["bus", "phase"])

    for bus, phase in (("b1", "B"), ("b2", "A"), ("b2", "C"), ("b3", "A")):
        V = theirs[f"{bus}.{LETTERS.index(phase) + 1}"] - theirs[f"{bus}.4"]
        assert table.loc[(bus, phase), "V"] == pytest.approx(abs(V), rel=1e-7)
        assert table.loc[(bus, phase), "to"] == "4"
    assert table.loc[("b2", "4"), "V"] == pytest.approx(abs(theirs["b2.4"]), rel=1e-5)
    assert table.loc[("mv", "A"), "to"] == ""


CENTRE_TAPPED = """Clear
New Circuit.test bus1=s basekv=12.47 r1=0.1 x1=0.5 r0=0.2 x0=0.9
New Transformer.t phases=1 windings=3 buses=(s.2.0 c.1.3 c.3.2) kvs=(7.2 0.12 0.12) kvas=(25 25 25)
~ xhl=2 xht=2 xlt=1.4 %rs=(0.6 1.2 1.2)
New Reactor.earth phases=1 bus1=c.3 bus2=c.0 R=0.5 X=0
New LineCode.triplex nphases=3 units=kft rmatrix=(0.1 | 0.04 0.1 | 0.04 0.04 0.15)
~ xmatrix=(0.05 | 0.03 0.05 | 0.03 0.03 0.05) cmatrix=(0 | 0 0 | 0 0 0)
New Line.service phases=3 bus1=c.1.2.3 bus2=d.1.2.3 linecode=triplex length=0.2 units=kft
New Load.one bus1=d.1.3 phases=1 kv=0.12 kw=5 kvar=1
New Load.two bus1=d.2.3 phases=1 kv=0.12 kw=3 kvar=1
New Load.both bus1=d.1.2 phases=1 kv=0.24 kw=4 kvar=1
Set VoltageBases=(12.47 0.208)
CalcVoltageBases
Solve
"""


def test_legs_of_a_split_phase_service_return_to_their_neutral(tmp_path: Path) -> None:
    """A roof on each leg of a centre-tapped service, whose neutral is node 3, has the engine's voltages."""
    (tmp_path / "Master.dss").write_text(CENTRE_TAPPED)
    feeder = gp.Feeder.read(tmp_path / "Master.dss")
    for leg in "AB":
        feeder = feeder.add_inverter(f"roof{leg}", "d", "GFL", 5e3, phases=leg)
    network, dynamics = started(feeder, frozenset(), 0.6)

    assert [row.neutral for row in feeder.inverters] == ["C", "C"]
    theirs = engine(CENTRE_TAPPED, *in_engine(network, dynamics, behind_filter=False))
    assert largest_difference(network, dynamics, frozenset(), theirs) < TOLERANCE


THREE_POLES = (
    STREET.format(n=4).replace(
        "New Line.a1 phases=4 bus1=b0.1.2.3.4 bus2=b1.1.2.3.4 linecode=alu4 length=180 units=m",
        "New Line.a1 phases=3 bus1=b0.1.2.3 bus2=b1.1.2.3 r1=0.06 x1=0.05 r0=0.06 x0=0.05 c1=0 c0=0\n"
        "New Line.pen phases=1 bus1=b0.4 bus2=b1.4 r1=0.1 x1=0.05 r0=0.1 x0=0.05 c1=0 c0=0",
    )
    + AT_TRANSFORMER
)
"""A street behind a switch of three poles, past which its neutral goes on to the transformer."""


def test_a_switch_that_leaves_the_neutral_closed_gives_a_warning(tmp_path: Path) -> None:
    """An island that its neutral still ties to the grid counts as fed by the grid, and a warning says so, once."""
    feeder, _ = imported(tmp_path, THREE_POLES)
    feeder = feeder.add_inverter("bat", "b1", "GFM", 6e4).add_inverter("roof", "b3", "GFL", 5e3, phases="A")
    plant, told = events_of(feeder, 0.4)

    assert len([text for text in told if text.startswith("bat: the neutral alone ties its part to the grid")]) == 1
    assert all(220.0 < reading.V < 236.0 for reading in plant.measure().values())
