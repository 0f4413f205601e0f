"""The factors of a sparse network in blocks of two, against dense matrices."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from gridpeers.plant.dynamics.kept_network import BlockPattern, elimination_order
from gridpeers.plant.dynamics.kernel.network_arrays import factorise_blocks, solve_blocks

Network = tuple[sp.csc_array, sp.csc_array]


def a_network(rng: np.random.Generator, nodes: int, meshes: int, *, shunt: complex = 1e-3j) -> Network:
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


def test_a_network_of_reactances_alone_needs_no_pivoting() -> None:
    """Its real form has zeros on the diagonal, but its blocks of a node are regular."""
    Y = sp.csc_array(np.array([[-3j, 1j, 1j], [1j, -2j, 0], [1j, 0, -2j]]))
    none = np.zeros(0, complex)
    factors = BlockPattern(Y, sp.csc_array((3, 0))).matrix(none, none)
    factorise_blocks(factors)
    x = np.array([1.0, 2.0, 0.0, -1.0, 3.0, 0.5])

    solution = x.copy()
    solve_blocks(factors, solution)

    np.testing.assert_allclose(Y @ solution.view(complex), x.view(complex), rtol=1e-12)


def test_a_tree_keeps_its_number_of_entries() -> None:
    """Eliminated from its leaves a tree of n nodes has n - 1 couplings and no fill."""
    Y, _ = a_network(np.random.default_rng(3), 200, 0)
    none = sp.csc_array((200, 0))
    order = elimination_order(Y, none)

    assert BlockPattern(Y[order][:, order].tocsc(), none).later.size == 199
