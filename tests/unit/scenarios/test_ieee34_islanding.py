"""What the catalogue's scenario on the IEEE 34-node feeder shows."""

from __future__ import annotations

import numpy as np

from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.results.record import Recorder
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.configs import configs

Shown = tuple[np.ndarray[tuple[int, ...], np.dtype[np.float64]], dict[str, float], list[str]]


def shown(case: str) -> Shown:
    """Return the last row (n_inv x 6: f, P, Q, V, P_set, V_set), when each switch closed, and texts of warnings."""
    scenario, feeder = load_scenario("ieee34-islanding")
    recorder = Recorder()
    run_inprocess(*configs(scenario, feeder, case), recorder)
    history = recorder.finish(scenario.time.end_s, scenario.time.record_s).history
    closed = {e.subject: e.t for e in recorder.case.events if e.kind == "switch" and "closed" in e.text}
    warnings = [event.text for event in recorder.case.events if event.kind in ("warning", "trip")]
    last = history.table[-1, 1:].reshape(-1, 6).copy()
    last[:, [1, 2, 4]] /= np.array([row.P_rated for row in feeder.inverters])[:, None]
    last[:, 3] /= [row.V_nom for row in feeder.inverters]
    return last, closed, warnings


def test_with_secondary_control_the_microgrids_rejoin_at_once() -> None:
    """Each island restores 60 Hz, so both switches find their sides in step."""
    last, closed, warnings = shown("IV")

    assert closed == {"832-832s": 8.0, "834-834s": 8.0}
    assert warnings == []
    np.testing.assert_allclose(last[:, 0], 60.0, atol=1e-3)
    assert 0.92 < last[2, 3] < 0.97, "bus 890 is behind the weak transformer, where the published voltage is 0.92 pu"
    np.testing.assert_allclose(np.delete(last[:, 3], 2), 1.0, atol=0.02)
    assert np.ptp(last[:, 1]) < 1e-3


def test_without_control_a_switch_between_two_microgrids_waits_in_vain() -> None:
    """Their frequencies differ by their droops, and the angle runs away while the voltages are too far apart."""
    last, closed, warnings = shown("I")

    assert closed == {"834-834s": 8.0}
    assert [text for text in warnings if "sw1_2" in text and "not closed: not in step within 4 s" in text]
    assert np.ptp(last[:, 0]) > 0.01
