"""How an event settles, against histories that everybody can check."""

from __future__ import annotations

import numpy as np
import pytest

from gridpeers.measures import History, Nameplates, Window, settling

PLATES = Nameplates(
    names=("leader", "follower"),
    GFM=np.array([True, False]),
    s=np.full(2, 1.0),
    V_nom=np.full(2, 1.0),
    m_p=np.full(2, 0.01),
    m_q=np.full(2, 0.05),
)


def test_frequency_and_sharing_are_timed_apart_and_a_swing_is_seen_where_it_is() -> None:
    """The frequency is back after 1.5 s, sharing after 2.5 s; then V of one swings by 0.02 pu, f by 0.004 Hz."""
    t = np.arange(0.0, 10.005, 0.01)
    late = 1.0 + 1e-9
    f = np.where(t < late + 1.49, 59.9, 60.0) + 0.002 * np.cos(2.0 * np.pi * t)
    P = np.stack([np.where(t < late + 2.49, 0.7, 0.5), np.full(t.size, 0.5)], axis=1)
    V = np.stack([np.full(t.size, 1.0), 1.0 + 0.01 * np.sin(2.0 * np.pi * t)], axis=1)
    both = np.stack([f, f], axis=1)
    history = History(inverters=PLATES.names, t=t, f=both, P=P, Q=P, V=V, P_set=P, V_set=V)

    found = settling(history, PLATES, Window(label="event", start=1.0, end=10.0), 60.0)

    assert found.t_f_s == pytest.approx(1.5, abs=0.011)
    assert found.t_share_s == pytest.approx(2.5, abs=0.011)
    assert found.f_swing_Hz == pytest.approx(0.004, rel=0.01)
    assert found.V_swing_pu == pytest.approx(0.02, rel=0.01)
