"""What the publications of the laws claim, on islanding: nine inverters, a full graph, two events."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

import gridpeers as gp
from gridpeers.agents.laws.consensus import Consensus
from gridpeers.agents.laws.event_triggered import EventTriggered
from gridpeers.agents.laws.finite_time import FiniteTime
from gridpeers.agents.laws.law import Law, Neighbour, Own
from tests.conformance.laws.law_runs import islanding, written

LAWS = ("consensus", "dapi", "event-triggered", "finite-time", "centralised", "resilient")


@pytest.mark.parametrize("law", LAWS)
def test_every_secondary_law_restores_frequency_and_shares_power(law: str) -> None:
    """Every published law reaches nominal frequency and equal shares after both events."""
    metrics = islanding(law).metrics

    assert (metrics["f_error_Hz"] < 0.01).all()
    assert (metrics["MPSI"] < 0.01).all()
    assert (metrics["t_restore_s"] < 1.0).all()


def test_dapi_shares_vars_exactly_or_regulates_voltage_or_makes_a_compromise() -> None:
    """Beta = 0 gives equal vars, b = 0 nominal voltage at the terminals; the tuning between lies between."""
    vars_, voltage = islanding("dapi", beta=0.0).metrics, islanding("dapi", b=0.0).metrics
    between = islanding("dapi").metrics

    assert (vars_["MQSI"] < 0.01).all()
    assert (voltage["V_error"] < 1.5e-3).all()
    assert (vars_["MQSI"] < between["MQSI"]).all()
    assert (between["MQSI"] < voltage["MQSI"]).all()
    assert (voltage["V_error"] < between["V_error"]).all()


def test_central_control_leaves_vars_to_droop_and_depends_on_its_centre() -> None:
    """One controller restores all and shares no vars; without its links after event 1 the frequency stays wrong."""
    fault = [{"on": "inv1 -> *", "cut": True, "from_s": 3.0}]
    alone = gp.load("islanding").replace({"case.IV.law": "centralised", "case.IV.link": fault, "paper": ""}).run("IV")

    assert (islanding("centralised").metrics["MQSI"] > 2.0 * islanding().metrics["MQSI"]).all()
    assert alone.metrics["f_error_Hz"]["event1"] < 0.01
    assert alone.metrics["MPSI"]["event2"] > 0.1


def test_event_triggered_consensus_sends_less() -> None:
    """Neighbours keep the last state, saved messages are a metric, and both drivers give the same bytes."""
    result = islanding("event-triggered", short=True)

    assert (islanding("event-triggered").metrics["messages_saved"] > 0.5).all()
    assert result.sha256 == written("event-triggered", driver="processes").sha256
    assert "messages_saved" not in islanding().metrics


Floats = NDArray[np.float64]
M_P = 0.01


def agreement(
    make: Callable[[], Law], P_set: Sequence[float], links: NDArray[np.bool_], T: float, steps: int
) -> tuple[Floats, int]:
    """Every agent's m_p P_set (pu) at each step, a row each, and how often one sent to its neighbours."""
    n, told = len(P_set), 0
    laws, y = [make() for _ in P_set], [list(P_set)]
    known = list(P_set)
    for k in range(steps):
        owns = [own(i, y[-1][i], k * T) for i in range(n)]
        if k == 0:
            for law, it in zip(laws, owns, strict=True):
                law.start(it)
        decided = [
            law.step(it, [neighbour(j, known[j]) for j in range(n) if links[i, j]], T)
            for i, (law, it) in enumerate(zip(laws, owns, strict=True))
        ]
        for i, decision in enumerate(decided):
            if decision.send:
                known[i], told = decision.P_set, told + 1
        y.append([decision.P_set for decision in decided])
    return M_P * np.array(y), told


def own(i: int, P_set: float, t: float) -> Own:
    """A follower at nominal frequency and voltage."""
    return Own(f"inv{i}", False, t, P_set, 0.0, 1.0, 0.0, 0.0, P_set, 1.0, M_P, 0.05, 1e5, 277.0, 60.0)


def neighbour(j: int, P_set: float) -> Neighbour:
    return Neighbour(f"inv{j}", False, 0.0, 1.0, P_set, 1.0, 0.0, M_P, 0.05, 1e5)


def ring(n: int) -> NDArray[np.bool_]:
    links = np.zeros((n, n), dtype=bool)
    for i in range(n):
        links[i, (i + 1) % n] = links[(i + 1) % n, i] = True
    return links


def laplacian(links: NDArray[np.bool_]) -> Floats:
    return np.diag(links.sum(axis=1).astype(float)) - links.astype(float)


P_SET = (0.1, 0.9, 0.4, 0.7, 0.2, 0.5)


def test_finite_time_consensus_agrees_before_the_time_of_its_theorem() -> None:
    """At T* all differences are those of rounding and one step; a linear law of the same gain is far from it."""
    links, gamma, c, T = ring(6), 0.5, 0.02, 1e-3
    eigenvalue = np.linalg.eigvalsh(laplacian(links))[1]
    y0 = M_P * np.array(P_SET)
    V_0 = 0.5 * np.sum((y0 - y0.mean()) ** 2)
    limit = 4.0 * V_0 ** ((1.0 - gamma) / 2.0) / (c * (1.0 - gamma) * (4.0 * eigenvalue) ** ((1.0 + gamma) / 2.0))

    y, _ = agreement(lambda: FiniteTime(gamma=gamma, c_P=c), P_SET, links, T, int(limit / T) + 1)
    linear, _ = agreement(lambda: Consensus(k_p=M_P / c), P_SET, links, T, int(limit / T) + 1)
    spread = np.ptp(y, axis=1)
    agreed = T * int(np.argmax(spread < 1e-7))

    assert 0.05 * limit < agreed < limit
    assert spread[-1] < 1e-7
    assert np.ptp(linear[-1]) > 100.0 * spread[-1]
    assert y[-1].mean() == pytest.approx(y0.mean(), rel=1e-9)  # a symmetric law keeps the mean


def test_event_based_broadcasting_agrees_within_its_radius_with_few_messages() -> None:
    """The radius is norm(L) sqrt(N) c_0 / lambda_2; c_0 = c_1 = 0 tells every step, and more tolerance tells less."""
    links, c_0, T, steps = ring(6), 1e-4, 0.002, 4000
    eigenvalues = np.linalg.eigvalsh(laplacian(links))
    radius = eigenvalues[-1] * np.sqrt(6.0) * c_0 / eigenvalues[1]

    y, told = agreement(lambda: EventTriggered(c_0=c_0, c_1=0.0), P_SET, links, T, steps)
    last = y[-1] - y[-1].mean()

    assert 0.0 < np.linalg.norm(last) <= radius
    assert 6 <= told < 0.1 * 6 * steps
    assert told < agreement(lambda: EventTriggered(c_0=0.1 * c_0, c_1=0.0), P_SET, links, T, steps)[1]


def test_without_tolerance_every_change_is_sent() -> None:
    """Then event-based broadcasting is the periodic law."""
    links, T = ring(6), 0.002
    y, told = agreement(lambda: EventTriggered(c_0=0.0, c_1=0.0), P_SET, links, T, 200)

    assert told == 6 * 200
    assert np.allclose(y, agreement(Consensus, P_SET, links, T, 200)[0], rtol=0.0, atol=1e-6)
