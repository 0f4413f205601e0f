"""The reduction by sparse factors: nodes taken out, blocks factored."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from gridpeers.plant.dynamics import power_flow_at_rest
from gridpeers.plant.dynamics.kept_network import BlockPattern, eliminated, elimination_order
from gridpeers.plant.dynamics.kernel.network_arrays import factorise_blocks, solve_blocks
from gridpeers.plant.dynamics.kernel.solve import NO_NETWORK
from gridpeers.plant.feeder import Plant
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings, SwitchEvent
from gridpeers.plant.tables import read_feeder

EVENTS = (
    SwitchEvent(t=0.1, switch="13-152", action="open"),
    SwitchEvent(t=0.3, switch="60-160", action="open"),
    SwitchEvent(t=0.5, switch="60-160", action="close"),
)


def rows() -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Return what is recorded of the microgrid feeder through its switchings."""
    plant = Plant(Network(read_feeder("microgrid123")), PlantSettings(events=EVENTS), 0.02, 0.02)
    for _ in range(40):
        plant.advance()
    return np.array(plant.take_rows())


def test_a_start_to_which_the_tangent_does_not_lead_is_found_by_newton(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the frozen tangent fails, e.g. across a limit of the loads' law, the operating point is the same."""
    plain, failures = rows(), iter([True, False] * 3)
    settle = power_flow_at_rest.settle_powers
    monkeypatch.setattr(
        power_flow_at_rest,
        "settle_powers",
        lambda *words: (NO_NETWORK, 0.0) if next(failures, False) else settle(*words),
    )

    np.testing.assert_allclose(rows(), plain, rtol=1e-9, atol=1e-3)
    assert not next(failures, False)


Matrices = tuple[sp.csc_array, sp.csc_array]


def a_network(rng: np.random.Generator, nodes: int, meshes: int, *, shunt: complex = 1e-3j) -> Matrices:
    """Return admittances (S) of a random tree with some more lines, and the incidence of loads at its nodes."""
    Y = np.diag(np.full(nodes, shunt))
    lines = [(k, int(rng.integers(k))) for k in range(1, nodes)]
    lines += [tuple(rng.choice(nodes, 2, replace=False).tolist()) for _ in range(meshes)]
    for i, j in lines:
        y = 1.0 / complex(*rng.uniform(0.1, 1.0, 2))
        Y[[i, j], [i, j]] += y
        Y[[i, j], [j, i]] -= y
    C = np.zeros((nodes, nodes // 2))
    for branch in range(C.shape[1]):
        first, second = rng.choice(nodes, 2, replace=False)
        C[first, branch] = 1.0
        C[second, branch] = -0.9 * (branch % 2)
    return sp.csc_array(Y), sp.csc_array(C)


def dense(Y: sp.csc_array, C: sp.csc_array, A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """Return V -> (Y + C A C') V + C B C' V^* on [Re V_1, Im V_1, Re V_2, ...]."""
    linear, conjugate = (Y + C @ sp.diags_array(A) @ C.T).toarray(), (C @ sp.diags_array(B) @ C.T).toarray()
    real = np.zeros((2 * Y.shape[0], 2 * Y.shape[0]))
    real[0::2, 0::2], real[0::2, 1::2] = (linear + conjugate).real, (conjugate - linear).imag
    real[1::2, 0::2], real[1::2, 1::2] = (linear + conjugate).imag, (linear - conjugate).real
    return real


@pytest.mark.parametrize("nodes", [1, 2, 7, 40])
@pytest.mark.parametrize("meshes", [0, 6])
def test_the_factors_solve_the_network_and_know_the_sign_of_its_determinant(nodes: int, meshes: int) -> None:
    """In the order of elimination, with loads' tangents of either sign, as LAPACK does."""
    rng = np.random.default_rng(nodes + meshes)
    Y, C = a_network(rng, nodes, meshes if nodes > 1 else 0)
    order = elimination_order(Y, C)
    assert sorted(order.tolist()) == list(range(nodes))
    signs = set()
    for size in (0.01, 1.0, 10.0):
        Y_k, C_k = Y[order][:, order].tocsc(), C[order].tocsc()
        A, B = size * rng.normal(size=(2, C.shape[1])) + 1j * size * rng.normal(size=(2, C.shape[1]))
        want = dense(Y_k, C_k, A, B)
        right = rng.normal(size=2 * nodes)

        factors = BlockPattern(Y_k, C_k).matrix(A, B)
        positive = factorise_blocks(factors)
        solution = right.copy()
        solve_blocks(factors, solution)

        np.testing.assert_allclose(want @ solution, right, atol=1e-8 * np.abs(solution).max() * np.abs(want).max())
        assert positive == (np.linalg.slogdet(want)[0] > 0)
        signs.add(positive)
    assert nodes < 40 or len(signs) == 2, "the loads must be large enough to turn the sign, or nothing is tested"


NONE = np.zeros(0, complex)


def solved(Y: sp.csc_array, right: np.ndarray) -> np.ndarray:
    """Return the solution by block factors, in the order of elimination."""
    order = elimination_order(Y, sp.csc_array((Y.shape[0], 0)))
    factors = BlockPattern(Y[order][:, order].tocsc(), sp.csc_array((Y.shape[0], 0))).matrix(NONE, NONE)
    factorise_blocks(factors)
    x = np.ascontiguousarray(right[order]).view(float).copy()
    solve_blocks(factors, x)
    solution = np.empty_like(right)
    solution[order] = x.view(complex)
    return solution


def meshed(rng: np.random.Generator, nodes: int) -> np.ndarray:
    """Return admittances (S) of which a third are missing, where y_ij is not y_ji and may be 0 where y_ji is not."""
    Y = (rng.normal(size=(nodes, nodes)) + 1j * rng.normal(size=(nodes, nodes))) * (rng.random((nodes, nodes)) < 0.3)
    return Y + np.diag(20.0 + np.abs(Y).sum(axis=0))


@pytest.mark.parametrize("seed", range(2))
def test_stored_zeros_and_one_way_couplings_have_entries_of_their_own(seed: int) -> None:
    """The factors solve a matrix that stores zeros, at random places, as LAPACK does."""
    rng = np.random.default_rng(seed)
    Y = meshed(rng, 12)
    at = [(i, j) for i in range(12) for j in range(12) if Y[i, j] or rng.random() < 0.2]
    stored = sp.csc_array(([Y[i, j] for i, j in at], tuple(zip(*at, strict=True))), shape=(12, 12))
    assert (stored.data == 0).any(), "no zero is stored, so nothing is tested"
    right = rng.normal(size=12) + 1j * rng.normal(size=12)

    np.testing.assert_allclose(solved(stored, right), np.linalg.solve(Y, right), rtol=1e-10)


def test_two_values_of_one_entry_count_both() -> None:
    """A matrix that stores an entry twice is the one with their sum."""
    Y = sp.csc_array((3, 3), dtype=complex)
    Y.indptr, Y.indices = np.array([0, 3, 6, 7]), np.array([0, 1, 1, 0, 0, 1, 2])
    Y.data = np.array([5.0, -1.0, -0.5, -2.0, 1.0, 4.0, 2.0], complex)
    right = np.array([1.0, 2.0, 3.0], complex)

    np.testing.assert_allclose(solved(Y, right), np.linalg.solve(Y.toarray(), right), rtol=1e-12)


def test_terms_that_cancel_leave_no_entry_and_no_neighbour_is_touched() -> None:
    """Two ways between two kept nodes that cancel exactly: the rest of the network has its admittances still."""
    Y = np.diag([4.0, 6.0, 8.0, 2.0, 2.0]).astype(complex)
    for i, j, y in ((0, 1, -1.0), (0, 2, -1.0), (1, 2, -2.0), (0, 3, -1.0), (3, 1, -1.0), (0, 4, 1.0), (4, 1, -1.0)):
        Y[i, j] = Y[j, i] = y
    Y[0, 1] = Y[1, 0] = 0.0
    keep = np.array([True, True, True, False, False])

    kept, reduced = eliminated(sp.csr_array(Y), keep)

    want = Y[:3, :3] - Y[:3, 3:] @ np.linalg.inv(Y[3:, 3:]) @ Y[3:, :3]
    assert kept.tolist() == [0, 1, 2]
    assert want[0, 1] == 0.0, "the ways do not cancel, so nothing is tested"
    np.testing.assert_allclose(reduced.toarray(), want, rtol=1e-12)
    assert (reduced.data != 0.0).all()


@pytest.mark.parametrize("seed", range(2))
def test_elimination_is_that_of_the_matrix_where_couplings_are_not_mutual(seed: int) -> None:
    """What is left of a network with y_ij unlike y_ji, or 0 where y_ji is not, is its Schur complement."""
    rng = np.random.default_rng(seed)
    Y = meshed(rng, 10)
    keep = np.arange(10) < 6

    kept, reduced = eliminated(sp.csr_array(Y), keep)

    gone = np.setdiff1d(np.arange(10), kept)
    assert gone.size, "nothing is eliminated"
    want = Y[np.ix_(kept, kept)] - Y[np.ix_(kept, gone)] @ np.linalg.solve(Y[np.ix_(gone, gone)], Y[np.ix_(gone, kept)])
    np.testing.assert_allclose(reduced.toarray(), want, atol=1e-12)


def in_series(cancels: bool) -> np.ndarray:
    """Return admittances (S) of nodes 0 and 1 with a reactance and its negative in series between, and a line on."""
    y = -2.0j
    Y = np.diag([3.0 - 1.0j, 4.0 + 0.0j, 0.0, 1.0 - 1.0j])
    for i, j, value in ((0, 2, y), (2, 1, -y if cancels else y), (1, 3, 1.0 - 1.0j)):
        Y[[i, j], [i, j]] += value
        Y[[i, j], [j, i]] -= value
    return Y


@pytest.mark.parametrize("cancels", [True, False])
@pytest.mark.parametrize("kept_nodes", [(0, 1), (0, 1, 2, 3)])
def test_a_node_whose_admittances_cancel_is_no_pivot(cancels: bool, kept_nodes: tuple[int, ...]) -> None:
    """Between a reactance and its negative in series a node has no own admittance, and yet its voltage."""
    Y = in_series(cancels)
    keep = np.isin(np.arange(4), kept_nodes)
    right = np.array([1.0, 2.0 - 1.0j, 0.0, 0.0])

    kept, reduced = eliminated(sp.csr_array(Y), keep)

    np.testing.assert_allclose(solved(reduced, right[kept]), np.linalg.solve(Y, right)[kept], rtol=1e-12)
