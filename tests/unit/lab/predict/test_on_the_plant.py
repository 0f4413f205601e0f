"""Predictions against the real agents on the real plant."""

from __future__ import annotations

import pytest

import gridpeers as gp
from gridpeers.lab.predict.droop_runs import VarResponse, load_steps, var_delay_limit, var_response
from gridpeers.lab.predict.linear_model import delay_limit
from gridpeers.lab.predict.times import LoadStep, predicted_times
from gridpeers.scenarios.schema import load_scenario
from tests.unit.lab.predict.predicted_graphs import inverters, on_the_plant, scenario_of

T_C = 0.02
ALL_BUT_9 = [f"inv{i}" for i in range(1, 9)]


@pytest.fixture(scope="module")
def event() -> LoadStep:
    """Islanding, as `gridpeers predict` learns it."""
    (step,) = load_steps(*scenario_of("full", end_s=4.0))
    assert step.load is not None
    return step.load


@pytest.fixture(scope="module")
def answers() -> VarResponse:
    return var_response(*load_scenario("islanding"))


def test_the_load_of_islanding_is_found_on_droop_alone(event: LoadStep) -> None:
    """It equals the load by the paper's 0.14 Hz at 1 % droop, 0.647 + 0.14 / 0.6, to 1 %."""
    assert event.start_pu == pytest.approx(0.647, abs=1e-6)
    assert event.load_pu == pytest.approx(0.647 + 0.14 / 0.6, rel=0.01)


@pytest.mark.parametrize("graph", ["full", "path"])
def test_with_constant_V_set_the_plant_restores_in_the_predicted_time(graph: str, event: LoadStep) -> None:
    """The linear model differs from the plant, which has limits and angles, by two control periods or 8 % at most."""
    predicted = predicted_times(inverters(graph), load=event).report_s
    measured = on_the_plant(graph, still_voltage=True, end_s=4.0).restored

    assert predicted is not None
    assert measured == pytest.approx(predicted, abs=2.0 * T_C + 1e-9, rel=0.08)


def test_a_star_around_a_leader_swings_when_its_links_are_too_slow() -> None:
    """Delay between agents destabilises it beyond the predicted limit, and not a star around a follower."""
    ticks = round(delay_limit(inverters("star"), "neighbours") / T_C) + 10
    leader = on_the_plant("star", link=ticks, end_s=12.0)
    follower = on_the_plant("star around inv2", link=ticks, end_s=12.0)

    assert leader.f_error[-200:].max() > 0.04
    assert follower.f_error[-50:].max() < 0.02


@pytest.mark.parametrize("graph", ["path"])
def test_vars_swing_first_with_a_late_plant(graph: str, answers: VarResponse) -> None:
    """The voltage is calm one period below the predicted limit of the var law, and swings two periods above it."""
    limit = round(var_delay_limit(inverters(graph), answers) / T_C)
    calm = on_the_plant(graph, setpoint=limit - 1, end_s=9.0)
    wild = on_the_plant(graph, setpoint=limit + 2, end_s=9.0)

    assert limit * T_C < delay_limit(inverters(graph), "local loop")
    assert calm.V[-50:].max() - calm.V[-50:].min() < 0.001
    assert wild.V[-50:].max() - wild.V[-50:].min() > 0.01


def test_run_and_prediction_leave_out_an_inverter_without_agent() -> None:
    """It stays on droop; the others restore the frequency and share equally in the predicted times."""
    event = {"label": "islanding", "t_s": 0.5, "open": ["13-152"]}
    scenario = gp.Scenario(
        time={"end_s": 2.5},
        event=[event],
        case={"IV": {"secondary": "all", "graph": "full", "without_agent": ["inv9"]}},
    )
    prediction = gp.predict(scenario, "IV", voltage=False)
    measured = scenario.replace({"gains.alpha": 0.0, "gains.beta_GFM": 0.0, "gains.beta_GFL": 0.0}).run("IV").metrics

    predicted = prediction.times["t_restore_s"].tolist()
    assert measured["t_restore_s"].tolist() == pytest.approx(predicted, abs=2.0 * T_C + 1e-9)
    assert "8 of 9 inverters run the law" in str(prediction)
    assert "inv9 without an agent" in " ".join(str(prediction).split())
    all_agents = scenario.replace({"case.IV.without_agent": None, "case.IV.secondary": ALL_BUT_9})
    listed = gp.predict(all_agents, "IV", voltage=False)
    assert set(listed.times["note"]) == {"1 of 9 inverters with an agent run no secondary law, and their power stays"}
