"""Lines, transformers, capacitors, reactors and switches have the voltages that the OpenDSS engine gives them."""

from pathlib import Path

import pytest

from plant.network import Network, solve_power_flow
from plant.opendss import read_opendss
from tests.unit.plant.opendss.opendss_solutions import (
    LINE,
    STEP_DOWN,
    TOLERANCE,
    engine_voltages,
    largest_difference,
    our_voltages,
    write,
)

pytest.importorskip("dss", reason="the import of .dss files needs the extra opendss")

LOADS = """New Load.a bus1=c.1 phases=1 kv=0.277 kw=60 kvar=20 model=1
New Load.bc bus1=c.2.3 phases=1 conn=delta kv=0.48 kw=80 kvar=40 model=5
"""
"""Uneven loads at bus c."""

DELTA_LOADS = """New Load.ab bus1=c.1.2 phases=1 conn=delta kv=0.48 kw=70 kvar=20 model=1
New Load.bc bus1=c.2.3 phases=1 conn=delta kv=0.48 kw=40 kvar=10 model=5
"""
"""Uneven loads at bus c that need no ground."""

T = "New Transformer.t phases=3 windings=2 xhl=4 %loadloss=1 kvs=(12.47 0.48) kvas=(500 500)"

TRANSFORMERS = {
    "wye-wye": f"{T} buses=(b c) conns=(wye wye)\n{LOADS}",
    "delta-wye": f"{T} buses=(b c) conns=(delta wye)\n{LOADS}",
    "delta-wye, leading": f"{T} buses=(b c) conns=(delta wye) leadlag=lead\n{LOADS}",
    "wye-delta": f"{T} buses=(b c) conns=(wye delta)\n{DELTA_LOADS}",
    "wye without ground, delta": f"{T} buses=(b.1.2.3.4 c) conns=(wye delta)\n{DELTA_LOADS}",
    "delta-delta": f"{T} buses=(b c) conns=(delta delta)\n{DELTA_LOADS}",
    "neutral through a resistor": f"{T} buses=(b c.1.2.3.4) conns=(delta wye) wdg=2 rneut=0.1\n{LOADS}",
    "losses, magnetising current": f"{T} buses=(b c) conns=(wye wye) %noloadloss=0.4 %imag=1 taps=(1.02 0.98)\n{LOADS}",
    "open wye, open delta": """New Transformer.t1 phases=1 xhl=3 buses=(b.1.0 c.1.2) kvs=(7.2 0.48) kvas=(200 200)
New Transformer.t2 phases=1 xhl=3 buses=(b.2.0 c.2.3) kvs=(7.2 0.48) kvas=(200 200)
New Reactor.corner bus1=c.2 bus2=c.2.0 phases=1 r=5 x=0.1
New Load.ab bus1=c.1.2 phases=1 conn=delta kv=0.48 kw=70 kvar=20
New Load.d bus1=c phases=3 conn=delta kv=0.48 kw=60 kvar=20
""",
    "centre-tapped": """New Transformer.t phases=1 windings=3 buses=(b.2.0 c.1.0 c.0.2)
~ kvs=(7.2 0.12 0.12) kvas=(25 25 25) xhl=2 xht=2 xlt=1.4 %rs=(0.6 1.2 1.2)
New LineCode.triplex nphases=2 units=kft rmatrix=(0.1 | 0.04 0.1) xmatrix=(0.05 | 0.03 0.05) cmatrix=(1 | 0 1)
New Line.service bus1=c.1.2 bus2=d.1.2 linecode=triplex length=0.1 units=kft
New Load.one bus1=d.1 phases=1 kv=0.12 kw=5 kvar=1
New Load.two bus1=d.2 phases=1 kv=0.12 kw=3 kvar=1
New Load.both bus1=d.1.2 phases=1 conn=delta kv=0.24 kw=6 kvar=1
""",
    "three windings": """New Transformer.t phases=3 windings=3 buses=(b c d) conns=(delta wye delta)
~ kvs=(12.47 0.48 4.16) kvas=(1000 500 500) xhl=5 xht=6 xlt=4
New Load.c bus1=c phases=3 kv=0.48 kw=200 kvar=50
New Load.d bus1=d phases=3 conn=delta kv=4.16 kw=150 kvar=50
""",
    "regulated": f"""New Transformer.r1 phases=1 xhl=0.5 buses=(b.1 r.1) kvs=(7.2 7.2) kvas=(1000 1000)
New Transformer.r2 phases=1 xhl=0.5 buses=(b.2 r.2) kvs=(7.2 7.2) kvas=(1000 1000)
New Transformer.r3 phases=1 xhl=0.5 buses=(b.3 r.3) kvs=(7.2 7.2) kvas=(1000 1000)
New RegControl.c1 transformer=r1 winding=2 vreg=124 band=2 ptratio=60 ctprim=100 r=2 x=1
New RegControl.c2 transformer=r2 winding=2 vreg=118 band=2 ptratio=60 ctprim=100 r=2 x=1
New RegControl.c3 transformer=r3 winding=2 vreg=121 band=2 ptratio=60
{T} buses=(r c) conns=(wye wye)
{LOADS}""",
    "autotransformer": """New AutoTrans.t phases=3 windings=2 buses=(b c) conns=(series wye) kvs=(12.47 4.16)
~ kvas=(1000 1000) xhx=4
New Load.c bus1=c phases=3 kv=4.16 kw=200 kvar=50
""",
}

ELEMENTS = {
    "capacitor, wye": "New Capacitor.k bus1=c phases=3 kvar=120 kv=0.48",
    "capacitor, delta": "New Capacitor.k bus1=c phases=3 kvar=120 kv=0.48 conn=delta",
    "capacitor, one phase": "New Capacitor.k bus1=c.2 phases=1 kvar=30 kv=0.277",
    "capacitor, steps": "New Capacitor.k bus1=c phases=3 kvar=(50 50 50) kv=0.48 numsteps=3 states=(1 0 1)",
    "capacitor, controlled": "New Capacitor.k bus1=c phases=3 kvar=120 kv=0.48\n"
    "New CapControl.x element=Transformer.down terminal=2 capacitor=k type=kvar onsetting=40 offsetting=-80 ctratio=1",
    "capacitor, in series": "New Capacitor.k bus1=c bus2=d phases=3 cuf=50000\n"
    "New Load.d bus1=d phases=3 kv=0.48 kw=40 kvar=10",
    "reactor, shunt": "New Reactor.x bus1=c phases=3 kvar=50 kv=0.48",
    "reactor, delta": "New Reactor.x bus1=c phases=3 kvar=50 kv=0.48 conn=delta",
    "reactor, in series": "New Reactor.x bus1=c bus2=d phases=3 r=0.01 x=0.03\n"
    "New Load.d bus1=d phases=3 kv=0.48 kw=40 kvar=10",
    "fault": "New Fault.f bus1=c.1 phases=1 r=2",
}

LINES = {
    "sequence impedances": "New Line.l bus1=c bus2=d r1=0.01 x1=0.02 r0=0.03 x0=0.06 c1=100 c0=50 length=1",
    "phases crossed": "New Line.l bus1=c.1.2.3 bus2=d.2.3.1 r1=0.01 x1=0.02 r0=0.03 x0=0.06 length=1",
    "in parallel": "New Line.l bus1=c bus2=d r1=0.01 x1=0.02 r0=0.03 x0=0.06 length=1\n"
    "New Line.m bus1=c bus2=d r1=0.03 x1=0.02 r0=0.05 x0=0.06 length=1",
    "a geometry": """New WireData.w rac=0.306 gmrac=0.0244 radius=0.36 runits=mi gmrunits=ft radunits=in
New LineGeometry.g nconds=4 nphases=3 reduce=yes cond=1 wire=w x=-4 h=28 units=ft cond=2 wire=w x=-1.5 h=28 units=ft
~ cond=3 wire=w x=3 h=28 units=ft cond=4 wire=w x=0 h=24 units=ft
New Line.l bus1=c bus2=d geometry=g length=200 units=ft""",
    "a neutral conductor": """New LineCode.four nphases=4
~ rmatrix=(0.05 | 0.01 0.05 | 0.01 0.01 0.05 | 0.01 0.01 0.01 0.06)
~ xmatrix=(0.08 | 0.03 0.08 | 0.03 0.03 0.08 | 0.03 0.03 0.03 0.09) cmatrix=(1 | 0 1 | 0 0 1 | 0 0 0 1)
New Line.l phases=4 bus1=c.1.2.3.4 bus2=d.1.2.3.4 linecode=four length=0.2
New Reactor.ground bus1=c.4 phases=1 r=0.1 x=0
New Load.n bus1=d.1.4 phases=1 kv=0.277 kw=30 kvar=5""",
}


@pytest.mark.parametrize("connection", TRANSFORMERS)
def test_a_transformer_is_the_engines(tmp_path: Path, connection: str) -> None:
    """Transformers of every connection, with uneven loads, have the engine's voltages."""
    assert largest_difference(write(tmp_path, LINE, TRANSFORMERS[connection])) < TOLERANCE


@pytest.mark.parametrize("element", ELEMENTS)
def test_a_capacitor_reactor_or_fault_is_the_engines(tmp_path: Path, element: str) -> None:
    """Capacitors, reactors and faults, shunt and in series, have the engine's voltages."""
    assert largest_difference(write(tmp_path, LINE, STEP_DOWN, LOADS, ELEMENTS[element])) < TOLERANCE


@pytest.mark.parametrize("line", LINES)
def test_a_line_is_the_engines(tmp_path: Path, line: str) -> None:
    """Lines by sequence impedances or geometry, with crossed phases, in parallel, with a neutral: all the engine's."""
    load = "New Load.d bus1=d.2 phases=1 kv=0.277 kw=50 kvar=10"

    assert largest_difference(write(tmp_path, LINE, STEP_DOWN, LOADS, LINES[line], load)) < TOLERANCE


def test_an_admittance_matrix_may_be_asymmetric(tmp_path: Path) -> None:
    """An element whose matrix differs from its transpose, by unequal sequence impedances, comes over as it is."""
    reactor = "New Reactor.x bus1=c bus2=d phases=3 z1=(0.01 0.04) z2=(0.02 0.01) z0=(0.03 0.09)"
    load = "New Load.d bus1=d.2 phases=1 kv=0.277 kw=50 kvar=10"
    path = write(tmp_path, LINE, STEP_DOWN, LOADS, reactor, load)
    (element,) = [element for element in read_opendss(path).elements if element.name == "reactor.x"]

    assert element.Y[0][1] != pytest.approx(element.Y[1][0])
    assert largest_difference(path) < TOLERANCE


@pytest.mark.parametrize("state", ["closed", "open"])
def test_a_switch_stands_as_in_the_script(tmp_path: Path, state: str) -> None:
    """Line with `switch=yes` becomes a switch that stands as in the script; what it cuts off has no voltage."""
    ring = """New Line.tie bus1=c bus2=d switch=yes r1=0.001 x1=0.001 r0=0.001 x0=0.001 c1=0 c0=0
New Line.l bus1=c bus2=e r1=0.01 x1=0.02 r0=0.02 x0=0.05 length=1
New Line.m bus1=e bus2=d r1=0.01 x1=0.02 r0=0.02 x0=0.05 length=1
New Load.d bus1=d phases=3 kv=0.48 kw=90 kvar=30
"""
    path = write(tmp_path, LINE, STEP_DOWN, ring, "Open Line.tie 1" if state == "open" else "")
    feeder = read_opendss(path)

    assert [(switch.alias, switch.closed) for switch in feeder.switches] == [("tie", state == "closed")]
    assert largest_difference(path) < TOLERANCE


def test_opening_a_switch_is_opening_the_line(tmp_path: Path) -> None:
    """Opened after the import, a switch gives the voltages that the engine has with the line opened in the script."""
    ring = """New Line.tie bus1=c bus2=d r1=0.01 x1=0.02 r0=0.02 x0=0.05 length=1
New Line.l bus1=c bus2=d r1=0.02 x1=0.02 r0=0.02 x0=0.05 length=1
New Load.d bus1=d phases=3 kv=0.48 kw=90 kvar=30
"""
    network = Network(read_opendss(write(tmp_path, LINE, STEP_DOWN, ring), switches=["Line.tie"]))
    solved = solve_power_flow(network, network.closed0 - {network.switch_name("tie")}, tolerance=1e-12)
    theirs = engine_voltages(write(tmp_path, LINE, STEP_DOWN, ring, "Open Line.tie 1"))

    for number, letter in enumerate("ABC", start=1):
        i = network.index("d", letter)
        assert abs(solved.V[i] - theirs[f"d.{number}"]) / network.V_nom[i] < TOLERANCE


def test_a_line_that_is_opened_becomes_a_switch(tmp_path: Path) -> None:
    """A line that the script opens is an open switch; the section behind it is dead, and its loads take nothing."""
    far = """New Line.l bus1=c bus2=d r1=0.01 x1=0.02 r0=0.02 x0=0.05 length=1
New Load.d bus1=d phases=3 kv=0.48 kw=90 kvar=30
Open Line.l 2
"""
    path = write(tmp_path, LINE, STEP_DOWN, LOADS, far)
    ours, nominal = our_voltages(path)
    theirs = engine_voltages(path)

    assert [switch.closed for switch in read_opendss(path).switches] == [False]
    assert all(ours[f"d.{number}"] == 0.0 for number in (1, 2, 3))
    for name, V in theirs.items():
        if not name.startswith("d."):
            assert abs(ours[name] - V) / nominal[name] < TOLERANCE


def test_a_line_may_be_open_in_one_phase(tmp_path: Path) -> None:
    """A line that the script opens in one phase alone keeps the others, and is no switch."""
    line = "New Line.l bus1=c bus2=d r1=0.01 x1=0.02 r0=0.02 x0=0.05 length=1\nOpen Line.l 1 2"
    load = "New Load.da bus1=d.1 phases=1 kv=0.277 kw=40\nNew Load.dc bus1=d.3 phases=1 kv=0.277 kw=30"
    path = write(tmp_path, LINE, STEP_DOWN, LOADS, line, load)

    assert read_opendss(path).switches == ()
    assert largest_difference(path) < TOLERANCE


def test_a_feeder_of_50_hertz_has_its_frequency(tmp_path: Path) -> None:
    """Reactances are those of the script's frequency, which becomes the feeder's nominal one."""
    path = write(tmp_path, LINE, STEP_DOWN, LOADS, ELEMENTS["capacitor, wye"])
    path.write_text(path.read_text().replace("DefaultBaseFrequency=60", "DefaultBaseFrequency=50"))

    assert read_opendss(path).f_nom == 50.0
    assert largest_difference(path) < TOLERANCE


def test_disabled_elements_are_not_there(tmp_path: Path) -> None:
    """What the script disables comes over as little as the engine takes it into account."""
    more = "New Load.off bus1=c phases=3 kv=0.48 kw=200 kvar=50 enabled=no\nNew Capacitor.k bus1=c kvar=100 kv=0.48\n"
    path = write(tmp_path, LINE, STEP_DOWN, LOADS, more, "Disable Capacitor.k")

    assert largest_difference(path) < TOLERANCE
    assert not [element for element in read_opendss(path).elements if element.name == "capacitor.k"]
