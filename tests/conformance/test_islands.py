"""A blackout and a black start, with agents: the run goes on, its events tell what happened, its numbers are true."""

from __future__ import annotations

from math import inf

import numpy as np
import pytest

from gridpeers.plant.tables import read_feeder
from gridpeers.scenarios.results.history import Floats, History, Nameplates, windows
from gridpeers.scenarios.results.metrics import measure
from gridpeers.scenarios.run_request import Outcome
from gridpeers.scenarios.schema import load_scenario
from tests.golden.catalogue.pins import ran


@pytest.fixture(scope="module")
def blackout() -> tuple[History, Outcome]:
    recorded, outcome = ran("blackout", "IV")
    return recorded.history, outcome


def test_a_blackout_does_not_end_the_run(blackout: tuple[History, Outcome]) -> None:
    """Collapse, de-energised island and black start are events; the run is whole and reproducible."""
    history, outcome = blackout
    kinds = [event.kind for event in outcome.events]

    assert not outcome.broke
    assert outcome.reproducible
    assert history.t[-1] == 13.0
    assert kinds.index("trip") < kinds.index("dead")
    assert any(event.text.startswith("black start by inv1") for event in outcome.events)


def test_a_de_energised_island_reads_zero_and_the_history_is_finite(blackout: tuple[History, Outcome]) -> None:
    """While nothing feeds the island, power, voltage and frequency are 0: not 60 Hz, not a number that is none."""
    history, _ = blackout
    dead = (history.t > 3.02) & (history.t < 9.0)

    for quantity in (history.f, history.P, history.Q, history.V):
        assert np.isfinite(quantity).all()
        assert not quantity[dead].any()


def test_metrics_are_finite_where_there_is_power_and_absent_where_there_is_none(
    blackout: tuple[History, Outcome],
) -> None:
    """Before the blackout and after the black start the paper's numbers hold; between there is nothing to measure."""
    history, outcome = blackout
    scenario, feeder = load_scenario("blackout")
    every = windows(scenario, outcome.events)
    found = {
        window.label: measure(window.cut(history), Nameplates.of(feeder.inverters), window, 60.0) for window in every
    }

    for label in ("islanding", "return"):
        steady = found[label]
        assert steady.f_error_Hz < 0.002
        assert steady.MPSI < 0.002
        assert steady.t_restore_s is not None
        assert steady.t_restore_s < 1.5
    for label in ("leave", "shedding"):
        assert np.isnan(found[label].f_error_Hz)
        assert found[label].t_restore_s is None
        assert found[label].t_load_s is None
        assert set(found[label].p.values()) == {0.0}


EVENT, END = 4.0, 9.0  # When the microgrid falls into three islands, and when it is looked at (s)
PLATES = Nameplates.of(read_feeder("microgrid123").inverters)


def history(case: str) -> History:
    return ran("unheard-switches", case)[0].history


def shares(case: str) -> Floats:
    """P of each inverter over its rating at the end."""
    of = history(case)
    return of.P[of.t >= END - 1e-9][0] / PLATES.s


def V_off(case: str) -> float:
    """Largest departure of an inverter's voltage from nominal at the end (pu)."""
    of = history(case)
    return float(np.abs(of.V[of.t >= END - 1e-9][0] / PLATES.V_nom - 1.0).max())


def f_off(case: str, since: float, until: float) -> tuple[Floats, Floats]:
    """Times (s), and the largest departure of an inverter from 60 Hz at each."""
    of = history(case)
    rows = (since < of.t) & (of.t < until)
    return of.t[rows], np.abs(of.f[rows] - 60.0).max(axis=1)


def outside(case: str, since: float, until: float) -> Floats:
    """Times (s) at which some inverter is more than 0.01 Hz off 60 Hz."""
    t, off = f_off(case, since, until)
    return t[off > 0.01]


@pytest.mark.parametrize("case", ["switches", "frequency"])
def test_each_island_has_60_hz_and_shares_among_its_own(case: str) -> None:
    """Full graph over three islands: agents leave out other islands, known by name or by frequency."""
    share = shares(case).reshape(3, 3)

    assert f_off(case, END - 0.001, END + 0.001)[1] == pytest.approx(0.0, abs=0.002)
    assert V_off(case) < 0.01
    assert np.ptp(share, axis=1).max() < 0.005
    assert share[0, 0] - share[1, 0] > 0.1


def test_islands_are_found_by_frequency_almost_as_fast_as_by_switches() -> None:
    """Restored 0.60 s after the switches opened, instead of 0.50 s."""
    told, seen = (outside(case, EVENT, END)[-1] - EVENT for case in ("switches", "frequency"))

    assert told < seen < told + 0.2


def test_an_agent_out_of_step_is_tried_again_after_ten_seconds_and_left_out_within_one() -> None:
    """A trial shows whether islands are one again; it costs a dip of less than 0.1 Hz."""
    again = outside("frequency", END, 20.0)

    assert len(outside("switches", END, 20.0)) == 0
    assert EVENT + 10.0 < again[0] < again[-1] < EVENT + 11.1
    assert 0.01 < f_off("frequency", END, inf)[1].max() < 0.1


def test_without_either_an_error_of_frequency_and_voltage_stays() -> None:
    """Without the rule the islands agree on set-points that suit none of them."""
    assert f_off("ignored", END - 0.001, END + 0.001)[1] > 0.02
    assert V_off("ignored") > 0.05
