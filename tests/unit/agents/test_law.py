from __future__ import annotations

from dataclasses import dataclass, replace

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gridpeers.agents.agent_config import DegradedCommunication, Gains
from gridpeers.agents.degraded_communication import gains_in_force
from gridpeers.agents.laws.consensus import Consensus, alpha_in_force
from gridpeers.wire.schema.table_schema import fields_of
from tests.unit.agents.law_steps import P_set_step, V_set_step

Matrix = NDArray[np.float64]

UNBOUNDED = Gains(P_set_min=-1e9, P_set_max=1e9, V_set_min=-1e9, V_set_max=1e9)
M_P = 0.01
KAPPA = M_P / UNBOUNDED.k_p
PERIODS = st.floats(-3.0, 1.0).map(lambda x: 10.0**x)  # From 1 ms to 10 s


@st.composite
def graphs(draw: st.DrawFn, most: int = 30) -> Matrix:
    """Adjacency of a connected graph: shapes that are known for trouble, or a random tree with random further links."""
    n = draw(st.integers(2, most))
    shape = draw(st.sampled_from(["path", "ring", "star", "full", "bipartite", "random"]))
    i, j = np.indices((n, n))
    if shape == "path":
        return np.asarray(abs(i - j) == 1, float)
    if shape == "ring":
        return np.asarray(((i - j) % n == 1) | ((j - i) % n == 1), float)
    if shape == "star":
        return np.asarray((i == 0) ^ (j == 0), float)
    if shape == "full":
        return 1.0 - np.eye(n)
    if shape == "bipartite":
        left = draw(st.integers(1, n - 1))
        return np.asarray((i < left) ^ (j < left), float)
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    A = np.triu(rng.random((n, n)) < rng.random(), 1).astype(float)
    for k in range(1, n):
        A[rng.integers(k), k] = 1.0
    return A + A.T


@st.composite
def fleets(draw: st.DrawFn, spread: float = 10.0) -> tuple[Matrix, NDArray[np.bool_], Matrix]:
    """A connected graph, its leaders (one at least) and everybody's rating, up to `spread` apart."""
    A = draw(graphs())
    n = len(A)
    leader = np.zeros(n, bool)
    leader[draw(st.lists(st.integers(0, n - 1), min_size=1, max_size=n, unique=True))] = True
    rating = np.array(draw(st.lists(st.floats(1.0, spread), min_size=n, max_size=n)))
    return A, leader, rating


def step_all(
    y: Matrix, A: Matrix, leader: NDArray[np.bool_], e: Matrix, T: float, *, kappa_c: float | None = None
) -> Matrix:
    """One period of the law for everybody, through the law itself; y = m_p P_set. With kappa_c degree-normalised."""
    d = A.sum(axis=1)
    y_bar = A @ y / np.maximum(d, 1.0)
    sums = d if kappa_c is None else np.ones(len(y))
    stepped = [
        P_set_step(
            y[i] / M_P, y_bar[i], sums[i], e[i], leader=bool(leader[i]), m_p=M_P, gains=UNBOUNDED, T=T, kappa_c=kappa_c
        )
        for i in range(len(y))
    ]
    return M_P * np.array(stepped)


def as_matrix(A: Matrix, leader: NDArray[np.bool_], w: Matrix, T: float, *, kappa_c: float | None = None) -> Matrix:
    """The map y -> y of one period, found by stepping the unit vectors, with the plant e = w y."""
    unit = np.eye(len(A))
    return np.array([step_all(y, A, leader, np.full(len(A), w @ y), T, kappa_c=kappa_c) for y in unit]).T


@settings(max_examples=250)
@given(fleets(), PERIODS, st.none() | st.floats(0.0, 3.0).map(lambda x: 10.0**x))
def test_frequency_and_sharing_are_stable_at_any_period_on_any_connected_graph(
    fleet: tuple[Matrix, NDArray[np.bool_], Matrix], T: float, kappa_c: float | None
) -> None:
    """With one leader or more every mode of P_set decays, 1 ms <= T <= 10 s, up to 30 agents, whatever the weights."""
    A, leader, rating = fleet

    M = as_matrix(A, leader, rating / rating.sum(), T, kappa_c=kappa_c)

    assert np.abs(np.linalg.eigvals(M)).max() < 1.0


@dataclass(frozen=True)
class Vars:
    """A fleet on a random network: v = 1 + v_0 + H V_set, z = z_0 + (1 - H) V_set."""

    C: Matrix
    """Weights c_ij."""
    leader: NDArray[np.bool_]
    H: Matrix
    v_0: Matrix
    z_0: Matrix
    gains: Gains

    @classmethod
    def drawn(cls, A: Matrix, leader: NDArray[np.bool_], rating: Matrix, seed: int, gains: Gains) -> Vars:
        """Draw the lines between the inverters, and what v and z are without V_set."""
        n, rng = len(A), np.random.default_rng(seed)
        lines = np.triu(rng.random((n, n)) * (rng.random((n, n)) < 0.3), 1)
        lines[np.arange(n - 1), np.arange(1, n)] += 0.1
        lines += lines.T
        shunts = 10.0 ** rng.uniform(-1.0, 1.0) * np.diag(rng.random(n) + 0.1)
        X = np.linalg.inv((np.diag(lines.sum(axis=1)) - lines) * 10.0 ** rng.uniform(0.0, 2.0) + shunts)
        K = X @ np.diag(rating) / 0.05
        H = np.linalg.solve(np.eye(n) + K, K)
        return cls(A, leader, H, rng.normal(0.0, 0.02, n), rng.normal(0.0, 0.02, n), gains)

    def at(self, V_set: Matrix) -> tuple[Matrix, Matrix]:
        return 1.0 + self.v_0 + self.H @ V_set, self.z_0 + V_set - self.H @ V_set

    def step(self, V_set: Matrix, T: float) -> Matrix:
        v, z = self.at(V_set)
        d = self.C.sum(axis=1)
        z_bar = self.C @ z / d
        return np.array(
            [
                V_set_step(V_set[i], z[i], z_bar[i], d[i], v[i], leader=bool(self.leader[i]), gains=self.gains, T=T)
                for i in range(len(d))
            ]
        )

    def affine(self, T: float) -> tuple[Matrix, Matrix]:
        """M and c of V_set -> M V_set + c, found by stepping 0 and the unit vectors."""
        c = self.step(np.zeros(len(self.C)), T)
        return np.array([self.step(unit, T) - c for unit in np.eye(len(self.C))]).T, c

    def continuous(self) -> tuple[Matrix, Matrix]:
        """R and r of the paper's k_q dV_set/dt = -(R V_set + r), (14) and (15), written down without the law."""
        gains = self.gains
        beta = np.where(self.leader, gains.beta_GFM, gains.beta_GFL)[:, None]
        alpha = np.where(self.leader, gains.alpha, 0.0)
        L = np.diag(self.C.sum(axis=1)) - self.C
        R = alpha[:, None] * self.H + beta * L @ (np.eye(len(L)) - self.H)
        return R, alpha * self.v_0 + beta[:, 0] * (L @ self.z_0)


def radius(M: Matrix) -> float:
    return float(np.abs(np.linalg.eigvals(M)).max())


@st.composite
def nets(draw: st.DrawFn, spread: float) -> Vars:
    """Random networks and gains, ratings up to `spread` apart, with the paper's weights or degree-normalised ones."""
    A, leader, rating = draw(fleets(spread=spread))
    weight = st.floats(-1.0, 1.0).map(lambda x: 10.0**x)
    gains = msgspec.structs.replace(UNBOUNDED, alpha=draw(weight), beta_GFM=draw(weight), beta_GFL=draw(weight))
    if draw(st.booleans()):
        gains = gains_in_force(
            gains, DegradedCommunication(weights="degree-normalised", beta_c=draw(st.floats(1.0, 30.0)))
        )
        A = A / A.sum(axis=1, keepdims=True)
    return Vars.drawn(A, leader, rating, draw(st.integers(0, 2**32 - 1)), gains)


@settings(max_examples=100)
@given(nets(spread=3.0), PERIODS)
def test_voltage_and_vars_are_stable_at_any_period_on_any_connected_graph(net: Vars, T: float) -> None:
    """With ratings up to threefold apart every mode of V_set decays, 1 ms <= T <= 10 s, whatever gains and weights."""
    assert radius(net.affine(T)[0]) < 1.0


@settings(max_examples=100)
@given(nets(spread=30.0), PERIODS)
def test_no_period_makes_vars_grow_where_the_papers_continuous_law_does_not(net: Vars, T: float) -> None:
    """With ratings up to thirtyfold apart every mode of V_set decays that decays in continuous time."""
    slowest = np.linalg.eigvals(net.continuous()[0]).real.min()

    assert slowest < 1e-6 or radius(net.affine(T)[0]) < 1.0


@settings(max_examples=100)
@given(nets(spread=3.0), PERIODS, st.floats(0.05, 1.0), st.integers(0, 2**32 - 1))
def test_voltage_and_vars_rest_where_the_papers_continuous_law_rests(
    net: Vars, T: float, least: float, seed: int
) -> None:
    """Where the discrete law rests, (14) and (15) are 0 to 1e-9, at every period and with ageing states too."""
    net = replace(net, C=net.C * np.random.default_rng(seed).uniform(least, 1.0, net.C.shape))
    M, c = net.affine(T)
    R, r = net.continuous()

    at_rest = np.linalg.solve(np.eye(len(c)) - M, c)

    assert R @ at_rest + r == pytest.approx(np.zeros(len(c)), abs=1e-9)


@given(st.floats(0.9, 1.1), st.floats(0.1, 30.0), PERIODS)
def test_an_adaptive_alpha_rests_where_it_stands_against_the_vars(v: float, d: float, T: float) -> None:
    """A leader rests where alpha(v) (v - 1) + beta d (z - z_bar) = 0, with the alpha in force there."""
    gains = Gains(alpha=4.0, alpha_min=0.25, V_full=0.02, beta_GFM=2.0)
    z_bar = 0.01
    z = z_bar - alpha_in_force(gains, v) * (v - 1.0) / (gains.beta_GFM * d)

    assert V_set_step(1.0, z, z_bar, d, v, leader=True, gains=gains, T=T) == pytest.approx(1.0, abs=1e-12)


@settings(max_examples=50)
@given(fleets(), st.integers(0, 2**32 - 1))
def test_a_short_period_gives_the_papers_derivative(fleet: tuple[Matrix, NDArray[np.bool_], Matrix], seed: int) -> None:
    """For T -> 0 a step is -kappa T (L y + g e), equations (12) and (13)."""
    A, leader, _ = fleet
    rng = np.random.default_rng(seed)
    y, e = rng.normal(size=len(A)), rng.normal(size=len(A))
    T = 1e-9
    L = np.diag(A.sum(axis=1)) - A

    rate = (step_all(y, A, leader, e, T) - y) / T

    assert rate == pytest.approx(-KAPPA * (L @ y + leader * e), rel=1e-5, abs=1e-4)


def test_a_short_period_gives_the_papers_derivative_of_the_voltage_too() -> None:
    """For T -> 0 a step is -T/k_q (alpha (v - 1) + beta d (z - z_bar)), (15), and a follower's has no alpha, (14)."""
    T, z, z_bar, d, v = 1e-9, 0.03, 0.01, 8.0, 0.98
    gains = Gains(k_q=0.5, alpha=5.0, beta_GFM=2.0, beta_GFL=1.5)

    leader = (V_set_step(1.0, z, z_bar, d, v, leader=True, gains=gains, T=T) - 1.0) / T
    follower = (V_set_step(1.0, z, z_bar, d, v, leader=False, gains=gains, T=T) - 1.0) / T

    assert leader == pytest.approx(-(5.0 * (v - 1.0) + 2.0 * d * (z - z_bar)) / 0.5, rel=1e-6)
    assert follower == pytest.approx(-(1.5 * d * (z - z_bar)) / 0.5, rel=1e-6)


@settings(max_examples=50)
@given(fleets(), PERIODS)
def test_frequency_and_sharing_rest_where_the_papers_law_rests(
    fleet: tuple[Matrix, NDArray[np.bool_], Matrix], T: float
) -> None:
    """Nothing moves exactly when all m_p P_set agree and the frequency is nominal, and nowhere else."""
    A, leader, rating = fleet
    w = rating / rating.sum()
    agreed = np.full(len(A), 0.004)

    assert step_all(agreed, A, leader, np.zeros(len(A)), T) == pytest.approx(agreed, abs=1e-15)
    assert np.linalg.matrix_rank(np.eye(len(A)) - as_matrix(A, leader, w, T), tol=1e-12) == len(A)


def test_the_papers_law_has_the_parameters_and_defaults_of_its_table() -> None:
    """The declarations of `[gains]` and of its class agree."""
    defaults = {field.name: field.default for field in fields_of(Consensus)}

    assert defaults.pop("kappa_c") == 0.0
    assert defaults == msgspec.structs.asdict(Gains())
