"""The paper's measures, against forms that everybody can check."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gridpeers.scenarios.results import metrics
from gridpeers.scenarios.results.history import History, Nameplates, Window
from gridpeers.scenarios.results.sharing_index import sharing_index

F_NOM = 60.0
PLATES = Nameplates(
    names=("inv1", "inv2", "inv3"),
    GFM=np.array([True, False, False]),
    s=np.array([600e3, 350e3, 350e3]),
    V_nom=np.full(3, 2400.0),
    m_p=np.full(3, 0.01),
    m_q=np.full(3, 0.05),
)


def history(t: list[float], f: list[float], p: list[list[float]], v: float = 1.0, q: float = 0.1) -> History:
    """Rows of three inverters: f (Hz) of all, p (pu) of each, v and q (pu) of all."""
    n = len(t)
    rows = [
        (
            t[k],
            *(
                x
                for i in range(3)
                for x in (f[k], p[k][i] * PLATES.s[i], q * PLATES.s[i], v * 2400.0, 0.65 * PLATES.s[i], 2400.0)
            ),
        )
        for k in range(n)
    ]
    return History.of(PLATES.names, rows)


def measured(case: History, start: float, end: float, plates: Nameplates = PLATES) -> metrics.Steady:
    """The measures of a window from one time to another (s)."""
    window = Window(label="event1", start=start, end=end)
    return metrics.measure(window.cut(case), plates, window, F_NOM)


powers = st.lists(st.floats(min_value=0.01, max_value=1.0), min_size=3, max_size=3)
droops = st.lists(st.floats(min_value=0.001, max_value=0.1), min_size=3, max_size=3)


@given(x=powers, s=powers, m=droops)
def test_the_sharing_index_is_equation_16_term_by_term(x: list[float], s: list[float], m: list[float]) -> None:
    """The array form equals (16) written as a loop over inverters."""
    eta = sum(x) / sum(s_i / m_i for s_i, m_i in zip(s, m, strict=True))
    total = 0.0
    for x_i, s_i, m_i in zip(x, s, m, strict=True):
        total += abs((m_i * x_i / s_i - eta) / eta)

    index = sharing_index(np.array([x]), np.array(s), np.array(m))

    assert index[0] == pytest.approx(total / 3)


def test_the_paper_s_own_case_II_gives_its_MPSI() -> None:
    """GFM at 1.0 pu, GFL at 0.65 + 0.08 / 0.6 pu: Table I prints 0.12 (nine inverters, section 3)."""
    s = np.array([600e3] * 3 + [350e3] * 6)
    p = np.array([1.0] * 3 + [0.65 + 0.08 / 0.6] * 6)

    assert sharing_index(np.array([p * s]), s, np.full(9, 0.01))[0] == pytest.approx(0.12, abs=0.005)


def test_a_steady_value_is_the_mean_of_the_last_fifth_of_a_second() -> None:
    """Rows before it, and the row at the next event's moment, do not count."""
    t = [round(0.1 * k, 9) for k in range(41)]
    f = [59.0] * 28 + [59.9, 59.8] + [58.0] * 11
    case = history(t, f, [[0.5] * 3] * 41)

    steady = measured(case, 1.0, 3.0)

    assert steady.f_error_Hz == pytest.approx((0.1 + 0.2) / 2)


EQUAL, UNEQUAL = [0.5] * 3, [0.5, 0.6, 0.5]


@pytest.mark.parametrize(
    ("f", "p", "expected"),
    [
        ([59.9, 60.0, 60.0, 60.0], [EQUAL] * 4, 0.2),
        ([60.0, 59.9, 60.0, 60.0], [EQUAL] * 4, 0.3),
        ([60.0, 60.0, 60.0, 60.0], [UNEQUAL, UNEQUAL, EQUAL, EQUAL], 0.3),
        ([60.0, 60.0, 60.0, 59.98], [EQUAL] * 4, None),
        ([60.0, 60.0, 60.0, 60.0], [EQUAL, EQUAL, EQUAL, UNEQUAL], None),
        ([60.0, 60.0, 60.0, 60.0], [EQUAL] * 4, 0.1),
    ],
)
def test_restored_means_frequency_and_sharing_both_and_for_good(
    f: list[float], p: list[list[float]], expected: float | None
) -> None:
    """Time counts from the event to the first row from which both hold to the end of the window."""
    case = history([1.0, 1.1, 1.2, 1.3, 1.4], [60.0, *f], [EQUAL, *p])

    steady = measured(case, 1.0, 1.4)

    assert steady.t_restore_s == expected


def test_every_GFM_must_be_restored() -> None:
    """Two GFM that are off to either side are not restored, though their mean is 60 Hz."""
    both = Nameplates(
        names=PLATES.names,
        GFM=np.array([True, True, False]),
        s=PLATES.s,
        V_nom=PLATES.V_nom,
        m_p=PLATES.m_p,
        m_q=PLATES.m_q,
    )
    case = history([0.0, 1.0, 2.0], [60.0] * 3, [EQUAL] * 3)
    case.f[:, 0] += 0.05
    case.f[:, 1] -= 0.05

    steady = measured(case, 1.0, 2.0, both)

    assert steady.t_restore_s is None
    assert steady.f_error_Hz == pytest.approx(0.05)


def test_who_is_off_the_network_is_not_counted() -> None:
    """Rows without inv3 are those of the two others alone: eta, (16), (17), V_error; steady p of it is 0."""
    case = history([1.0, 1.1, 1.2], [60.0] * 3, [EQUAL, EQUAL, EQUAL])
    case.P[1:, 2] = 0.0
    case.Q[1:, 2] = 0.0
    case.V[1:, 2] = 0.0

    steady = measured(case, 1.0, 1.2)

    assert case.present.tolist() == [[True] * 3, [True, True, False], [True, True, False]]
    assert metrics.MPSI(case, PLATES) == pytest.approx([0.0] * 3, abs=1e-12)
    assert metrics.MQSI(case, PLATES) == pytest.approx([0.0] * 3, abs=1e-12)
    assert metrics.V_error(case, PLATES) == pytest.approx([0.0] * 3, abs=1e-12)
    assert steady.p["inv3"] == 0.0
    assert steady.t_restore_s == pytest.approx(0.1)


def test_a_GFM_that_is_off_does_not_hold_back_the_frequency() -> None:
    """The reading of a GFM off the network is no frequency of the island; without a GFM there is none."""
    both = replace(PLATES, GFM=np.array([True, True, False]))
    case = history([0.0, 1.0, 2.0], [60.0] * 3, [EQUAL] * 3)
    case.f[:, 1] = 55.0
    case.P[:, 1] = case.Q[:, 1] = 0.0

    assert measured(case, 0.0, 2.0, both).t_restore_s == 1.0
    case.P[:, 0] = case.Q[:, 0] = 0.0
    assert np.isnan(metrics.mean_frequency(case, both)).all()
    assert measured(case, 0.0, 2.0, both).t_restore_s is None


def test_the_load_is_carried_once_the_total_stays_at_its_steady_value() -> None:
    """The others make up for inv3 in the second row after it left; until then power is missing."""
    case = history([1.0, 1.1, 1.2, 1.3, 1.4], [60.0] * 5, [EQUAL] * 5)
    case.P[1:, 2] = 0.0
    case.P[2:, 0] += case.P[0, 2]

    steady = measured(case, 1.0, 1.4)

    assert steady.t_load_s == pytest.approx(0.2)
