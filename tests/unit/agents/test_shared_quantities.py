"""What a law shares beside the paper's values: declared by its carrier, and checked at both ends."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Annotated

import pytest
from msgspec.structs import replace

import gridpeers as gp
from gridpeers.agents.agent import Agent
from gridpeers.agents.agent_config import LawChoice, SharedQuantity
from gridpeers.agents.carriers.law_check import law_problems
from gridpeers.agents.carriers.law_registry import shared_by
from gridpeers.agents.laws.law import Law, Neighbour, Own, SetPoints
from gridpeers.scenarios.schema.plugin_keys import law_of
from gridpeers.wire.messages import SHARED_LIMIT, State
from tests.toy.toy_configs import ALL_FULL, agent_config
from tests.toy.toy_messages import measurement, state

OMEGA = SharedQuantity(name="Omega", unit="pu", low=-0.05, high=0.05, help="Integral.")
PROGRAM = {"command": ["cat"], "shared": [{"name": "Omega", "unit": "pu", "low": -0.05, "high": 0.05}]}


class Shares(Law):
    """Shares Omega: 0 at first, and another value from the second step on."""

    then: Mapping[str, float] = MappingProxyType({"Omega": 0.1})

    Omega: Annotated[float, gp.SHARED, gp.Unit("pu"), gp.Range(-0.05, 0.05), "Integral."]
    rest: Annotated[float, gp.SHARED, "What is left."]

    def start(self, own: Own) -> None:
        self.steps = 0

    def step(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> SetPoints:
        self.steps += 1
        return SetPoints(own.P_set, own.V_set, {"Omega": 0.0} if self.steps == 1 else self.then)


class Taken(Shares):
    """Shares what the plant has."""

    V: Annotated[float, gp.SHARED, "Voltage."]


def agent(law: Law | None = None) -> Agent:
    control = replace(ALL_FULL, law=LawChoice(use=f"{__name__}:Shares", shared=(OMEGA,)))
    made = Agent(agent_config("inv1", control), law or Shares())
    made.meet(Agent(agent_config("inv2", control)).nameplate)
    return made


def sharing(k: int, Omega: float) -> State:
    return state("inv2", k, shared={"Omega": Omega, "other": 7.0})


def test_a_class_declares_by_fields_that_are_no_parameters() -> None:
    choice = LawChoice(use=f"{__name__}:Shares")

    assert shared_by(choice) == (
        OMEGA,
        SharedQuantity(name="rest", low=-SHARED_LIMIT, high=SHARED_LIMIT, help="What is left."),
    )
    assert law_problems({"use": choice.use}) == []
    ((key, text),) = law_problems({"use": choice.use, "Omega": 0.1})
    assert (key, text.partition(";")[0]) == ("Omega", "unknown parameter")


def test_a_name_of_the_plant_is_taken() -> None:
    """A record has quantities of the plant and of laws."""
    ((key, text),) = law_problems({"use": f"{__name__}:Taken"})

    assert (key, text) == ("use", "shares V, a quantity of the plant; give it another name")


def test_a_scenario_declares_for_a_program_and_for_no_other_carrier() -> None:
    assert law_problems(PROGRAM) == []
    ((key, text),) = law_problems({"use": "dapi", "shared": [{"name": "Omega"}]})
    assert (key, text) == ("shared", "is for a program; a class declares fields, an FMU outputs shared_NAME")
    ((key, text),) = law_problems({**PROGRAM, "shared": [{"name": "Omega", "low": 1.0, "high": 0.0}]})
    assert key == "shared[0].low"
    assert "must not be above high = 0" in text


def test_the_configuration_carries_what_a_law_declares() -> None:
    """Every process, the record and the scenario as run have units and ranges without the law."""
    scenario = gp.load("islanding")

    assert law_of(scenario.replace({"law": f"{__name__}:Shares"}).spec, "IV").shared[0] == OMEGA
    assert law_of(scenario.replace({"law": PROGRAM}).spec, "IV").shared == (replace(OMEGA, help=""),)
    assert law_of(scenario.spec, "IV").shared == ()


def test_an_fmu_declares_by_its_outputs(tmp_path: Path) -> None:
    """Unit, min, max and description of the outputs count."""
    pytest.importorskip("fmpy")
    variable = '<ScalarVariable name="{}" valueReference="{}" causality="output"{}><Real{}/></ScalarVariable>'
    omega = variable.format("shared_Omega", 2, ' description="Integral."', ' unit="pu" min="-0.05" max="0.05"')
    variables = variable.format("P_set", 0, "", "") + variable.format("V_set", 1, "", "") + omega
    with zipfile.ZipFile(tmp_path / "law.fmu", "w") as packed:
        packed.writestr(
            "modelDescription.xml",
            '<fmiModelDescription fmiVersion="2.0" modelName="law" guid="1"><CoSimulation modelIdentifier="law"/>'
            '<UnitDefinitions><Unit name="pu"/></UnitDefinitions>'
            f"<ModelVariables>{variables}</ModelVariables><ModelStructure/></fmiModelDescription>",
        )

    assert shared_by(LawChoice(fmu="law.fmu", folder=str(tmp_path))) == (OMEGA,)
    assert shared_by(LawChoice(fmu="none.fmu", folder=str(tmp_path))) == ()


@pytest.mark.parametrize(("then", "said"), [
    ({"Omega": 0.1}, "Omega, which must be from -0.05 to 0.05 pu, got 0.1"),
    ({"Omga": 0.0}, 'Omga, which it does not declare; did you mean "Omega"? The quantities are Omega'),
])  # fmt: skip
def test_a_law_that_shares_a_value_beyond_its_range_or_another_name_fails(then: dict[str, float], said: str) -> None:
    law = Shares()
    law.then = then
    it = agent(law)

    first, second = it.tick(measurement(0)), it.tick(measurement(1))

    assert first.shared == {"Omega": 0.0}
    assert second.idle
    assert f"step at t = 0.02 s shares {said}" in it.fault


def test_a_state_with_a_value_beyond_its_range_is_dropped_and_counted() -> None:
    """The last good state stays; an undeclared value has no range."""
    it = agent()

    assert it.hear(sharing(1, 0.05))
    assert not it.hear(sharing(2, 0.06))

    assert it.heard["inv2"].seq == 1
    assert it.rejects.counts == {"implausible": 1}
    (line,) = it.rejects.take_lines()
    assert "it shares Omega, which must be from -0.05 to 0.05 pu, got 0.06" in line
