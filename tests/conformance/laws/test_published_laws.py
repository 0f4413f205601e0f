"""What the publications of the laws claim, on islanding: nine inverters, a full graph, two events."""

from __future__ import annotations

import pytest

import gridpeers as gp
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
    """One controller restores all and shares no vars; if its links are cut after event 1, nobody is restored again."""
    fault = [{"on": "inv1 -> *", "cut": True, "from_s": 3.0}]
    alone = gp.load("islanding").replace({"case.IV.law": "centralised", "case.IV.link": fault, "paper": ""}).run("IV")

    assert (islanding("centralised").metrics["MQSI"] > 2.0 * islanding().metrics["MQSI"]).all()
    assert alone.metrics["f_error_Hz"]["event1"] < 0.01
    assert alone.metrics["MPSI"]["event2"] > 0.1


def test_event_triggered_consensus_tells_less() -> None:
    """Neighbours keep the last state; messages saved are a metric; in lock-step tokens keep time, to the byte."""
    result = islanding("event-triggered", short=True)

    assert (islanding("event-triggered").metrics["messages_saved"] > 0.5).all()
    assert result.sha256 == written("event-triggered", driver="processes").sha256
    assert "messages_saved" not in islanding().metrics
