"""What a longer control period changes of voltage and vars on the plant: how soon they come to rest, and not where."""

from __future__ import annotations

import msgspec
import pytest

from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.sweep.sweep_case import run_one


def steady(T_c: float, end_s: float) -> tuple[float, float]:
    """MQSI and V_error (pu) at the end of the scenario islanding, case IV, without its second event."""
    spec, _ = load_scenario("islanding")
    time = msgspec.structs.replace(spec.time, T_c_s=T_c, end_s=end_s)
    done = run_one(0, msgspec.structs.replace(spec, time=time, events=spec.events[:1]), "IV")
    assert done.status == "ran", done.why
    MQSI, V_error = done.measures["event1.MQSI"], done.measures["event1.V_error"]
    assert MQSI is not None
    assert V_error is not None
    return MQSI, V_error


def test_vars_are_as_equal_and_voltage_as_near_at_any_control_period() -> None:
    """MQSI and V_error at T_c 20 and 100 ms are those at 2 ms, where the law is nearly the paper's, to 2 %."""
    shortest = steady(0.002, 11.0)

    assert shortest == pytest.approx((0.0058, 0.00175), rel=0.01)
    assert steady(0.02, 16.0) == pytest.approx(shortest, rel=0.02)
    assert steady(0.1, 31.0) == pytest.approx(shortest, rel=0.02)
