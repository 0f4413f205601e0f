"""The islands of a large network, advanced in parts on several threads."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from gridpeers.plant.dynamics import Circuit, Dynamics, island_parts
from gridpeers.plant.dynamics.circuit import LoadLaw
from gridpeers.plant.dynamics.kernel.compiled import Real
from tests.unit.plant.dynamics.circuits import BALANCED, GFL_D, GFM_D, S_B, V_B, Z_B, inverter

ISLANDS = 5


def islands(load: float = 0.3, count: int = ISLANDS, *, fed: bool = False) -> Dynamics:
    """Islands, each of a GFM, a GFL and constant power, at rest; the load (pu) of the third then changes.

    With `fed` there is one more, which an ideal source feeds through a line, with loads and without inverters.
    """
    pair = np.array([[1.0, -1.0], [-1.0, 1.0]])
    line = np.kron(np.eye(count), np.kron(20.0 * pair / Z_B, np.eye(3)))
    chain = np.kron(20.0 * np.array([[1.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]]) / Z_B, np.eye(3))
    n, more = 6 * count, 9 if fed else 0
    whole = n + more
    circuit = Circuit(
        Y=sp.csc_array(sp.block_diag([line, chain[:more, :more]]) + 0.01 * sp.eye_array(whole) / Z_B),
        sources=np.arange(n, n + min(more, 3)),
        source_voltage=V_B * BALANCED[: min(more, 3)],
        terminals=np.arange(n).reshape(2 * count, 3),
        C=sp.csc_array(np.eye(whole)),
        loads=LoadLaw(S=np.full(whole, 0.3 * S_B / 3.0 + 0j), I0=np.zeros(whole, complex)),
        V_branch=V_B * np.tile(BALANCED, whole // 3),
    )
    dynamics = Dynamics(circuit, (inverter(GFM_D), inverter(GFL_D)) * count, 0.002)
    dynamics.start(np.full(2 * count, 0.3), np.zeros(2 * count))
    net = dynamics.network.net
    net.S[net.branch_island == net.inverter_island[min(4, count)]] *= load / 0.3
    return dynamics


def readings(dynamics: Dynamics) -> Real:
    """Let each inverter go to a power of its own, and return 200 steps."""
    rows = []
    for k in range(4):
        dynamics.inverters.set_points[:, 0] = 0.2 + 0.01 * np.arange(len(dynamics.inverters)) * (k + 1)
        rows.append(dynamics.run(50))
    return np.concatenate(rows)


@pytest.mark.parametrize("PART", [6, 10])
def test_parts_give_what_all_islands_give_at_once(monkeypatch: pytest.MonkeyPatch, PART: int) -> None:
    """In parts of one island or two the readings are those of all at once, within the tolerance of a solution."""
    at_once = readings(islands())
    monkeypatch.setattr(island_parts, "PART", PART)
    dynamics = islands()

    parts = dynamics.network.parts(dynamics.arrays())
    assert parts is not None
    assert len(parts) == {6: ISLANDS, 10: 2}[PART]
    assert np.ptp(at_once[-1, :, 1]) > 0.01 * S_B
    assert readings(dynamics) == pytest.approx(at_once, rel=1e-9, abs=1e-9 * S_B)


@pytest.mark.parametrize(("count", "parts"), [(1, 1), (3, 3)])
def test_an_island_without_inverters_is_not_stepped(monkeypatch: pytest.MonkeyPatch, count: int, parts: int) -> None:
    """Nothing in it moves: readings, and the voltages of all branches, are those of all islands at once."""
    at_once = islands(count=count, fed=True)
    expected = readings(at_once)
    monkeypatch.setattr(island_parts, "PART", 6)
    dynamics = islands(count=count, fed=True)

    found = dynamics.network.parts(dynamics.arrays())
    assert found is not None
    assert [part.nodes for part in found.parts] == [6] * parts
    assert readings(dynamics) == pytest.approx(expected, rel=1e-9, abs=1e-9 * S_B)
    assert dynamics.network.V_branch == pytest.approx(at_once.network.V_branch, rel=1e-9)


def test_the_number_of_cores_does_not_move_a_byte(monkeypatch: pytest.MonkeyPatch) -> None:
    """One thread and three give the same readings, byte by byte."""
    monkeypatch.setattr(island_parts, "PART", 6)
    found = []
    for cores in (1, 3):
        monkeypatch.setattr(island_parts, "usable_cores", lambda cores=cores: cores)
        found.append(readings(islands()).tobytes())

    assert found[0] == found[1]


def test_an_island_without_solution_ends_as_it_does_among_all_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The island with more load than it can carry is de-energised, at the same step, and the others continue."""
    at_once = islands(load=9.0)
    expected = readings(at_once)
    monkeypatch.setattr(island_parts, "PART", 6)
    parts = islands(load=9.0)

    assert readings(parts) == pytest.approx(expected, rel=1e-9, abs=1e-9 * S_B)
    assert [trip[:3] for trip in parts.take_trips()] == [trip[:3] for trip in at_once.take_trips()]
    assert parts.network.reduction.online.tolist() == [i not in (4, 5) for i in range(2 * ISLANDS)]
