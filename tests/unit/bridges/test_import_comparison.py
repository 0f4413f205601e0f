"""After an import our power flow is held against that of the program that read the feeder."""

from pathlib import Path

import msgspec
import pytest

from gridpeers.bridges.import_comparison import difference, loads_without_ground
from gridpeers.bridges.opendss import read_opendss
from gridpeers.plant.network import Network, solve_power_flow
from tests.unit.bridges.opendss.opendss_solutions import LINE, STEP_DOWN, write

pytest.importorskip("dss", reason="the import of .dss files needs the extra opendss")

BEHIND = """New Transformer.t phases=3 xhl=4 buses=(b d) conns=(delta CONNECTION) kvs=(12.47 0.48) kvas=(500 500)
New Load.w bus1=d phases=3 conn=wye kv=0.48 kw=300 pf=1
"""


def test_a_difference_is_found_where_it_is(tmp_path: Path) -> None:
    """A voltage that is off by a thousandth is found at its node; equal ones do not differ."""
    feeder = read_opendss(write(tmp_path, LINE, STEP_DOWN, "New Load.l bus1=c phases=3 kv=0.48 kw=90 kvar=20"))
    network = Network(feeder)
    theirs = dict(zip(network.nodes, solve_power_flow(network, network.closed0).V.tolist(), strict=True))

    assert difference(feeder, theirs)[0] < 1e-9
    worst, node, _ = difference(feeder, theirs | {("c", "B"): theirs["c", "B"] * 1.001})
    assert node == ("c", "B")
    assert worst == pytest.approx(1e-3, rel=0.05)


@pytest.mark.parametrize(
    ("connection", "ground", "named"), [("delta", 1.0, ["load.w"]), ("delta", 0.5, []), ("wye", 1.0, [])]
)
def test_constant_power_without_ground_is_named(
    tmp_path: Path, connection: str, ground: float, named: list[str]
) -> None:
    """Behind a delta winding, a wye load of constant power needs a stronger ground than its own 0.77 ohm a phase."""
    reactor = f"New Reactor.g bus1=d phases=3 r={ground} x=0"
    script = write(tmp_path, LINE, BEHIND.replace("CONNECTION", connection), reactor)
    feeder = read_opendss(script)

    assert loads_without_ground(feeder) == named


def test_two_solutions_are_told_from_a_difference(tmp_path: Path) -> None:
    """Where the law of a load jumps, another program's solution can be another one than ours, and both are right."""
    load = "New Load.l bus1=c phases=3 kv=0.48 kw=300 kvar=240 model=4"
    feeder = read_opendss(write(tmp_path, LINE, STEP_DOWN, load))
    network = Network(feeder)
    upper = solve_power_flow(network, network.closed0).V
    at = [network.index("c", phase) for phase in "ABC"]
    V_min = (abs(upper[at]) / network.V_nom[at]).min() - 1e-4  # just below, so that the load is still within
    parts = tuple(msgspec.structs.replace(part, V_min=V_min) for part in feeder.load_parts)
    network = Network(msgspec.structs.replace(feeder, load_parts=parts))
    lower = solve_power_flow(network, network.closed0, start=0.9 * network.nominal).V

    found = difference(network.feeder, dict(zip(network.nodes, lower.tolist(), strict=True)))
    wrong = difference(network.feeder, dict(zip(network.nodes, (1.001 * lower).tolist(), strict=True)))

    assert found.largest > 1e-4
    assert found.two_solutions
    assert not wrong.two_solutions
