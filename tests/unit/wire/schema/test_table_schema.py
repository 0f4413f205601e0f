"""One schema: the fields of a table and the parameters of a plug-in are declared, read and refused alike."""

from typing import Annotated, Any

import msgspec
import pytest

from gridpeers.agents.carriers.law_registry import LAWS
from gridpeers.plant.tables.feeder_columns import TABLES, LoadColumns
from gridpeers.scenarios.reference import page
from gridpeers.wire.schema.table_reading import parameter_values, read_parameters, read_table
from gridpeers.wire.schema.table_schema import Below, Divides, Plausible, Range, Unit, fields_of

Gain = Annotated[float, Unit("1/s"), Range(0, 100), Below("most"), "Rate of the law."]
Step = Annotated[float, Unit("s", in_key=False), Plausible("a step", 1e-5, 0.02, above_zero=True), Divides("period")]


class Table(msgspec.Struct, kw_only=True):
    """A table of a file."""

    gain: Gain = 5.0
    most: float = 10.0
    step: Step = 0.002
    period: float = 0.02
    order: int


class Parameters:
    """A plug-in with the same fields."""

    gain: Gain = 5.0
    most: float = 10.0
    step: Step = 0.002
    period: float = 0.02
    order: int


@pytest.mark.parametrize("given", [
    {"order": 1, "gain": 500},
    {"order": 1, "gain": "5 s"},
    {"order": 1, "gain": 20.0},
    {"order": 1, "step": 0.003},
    {"order": 1, "step": 2.0},
    {"order": 1.5},
    {"order": True, "gain": float("nan")},
    {},
])  # fmt: skip
def test_a_key_and_a_parameter_of_the_same_annotations_have_the_same_problems(given: dict[str, Any]) -> None:
    """Type, range, unit, relation and absence are one reader's business, whatever declares them."""
    of_table, of_parameters = read_table(Table, given)[1], read_parameters(Parameters, given)[1]

    assert of_table
    assert of_parameters == of_table


def test_values_within_all_rules_are_taken_as_they_are() -> None:
    """A field that is left out has its default, and a whole number becomes the number that the field asks for."""
    assert parameter_values(Parameters, {"order": 2, "gain": 1}) == {
        "gain": 1.0,
        "most": 10.0,
        "step": 0.002,
        "period": 0.02,
        "order": 2,
    }


@pytest.mark.parametrize("name", LAWS.names)
def test_every_parameter_of_a_law_is_on_the_reference_page_with_unit_and_range(name: str) -> None:
    """The page is made from the annotations: nothing is described twice."""
    text = page("laws").partition(f"## {name}\n")[2].partition("\n## ")[0]

    for field in fields_of(LAWS.resolve(name)):
        (row,) = [line for line in text.splitlines() if line.startswith(f"| `{field.key}` |")]
        assert f"| {field.unit} | {field.span} |" in row
        assert row.rstrip(" |").endswith(field.help)
        assert field.help


@pytest.mark.parametrize("columns", [*TABLES.values(), LoadColumns])
def test_every_column_of_a_feeder_is_on_the_reference_page_with_its_meaning(columns: type[msgspec.Struct]) -> None:
    """A column without a sentence would have an empty cell."""
    rows = [line for line in page("feeder").splitlines() if line.startswith("| `")]

    for field in fields_of(columns):
        assert any(row.startswith(f"| `{field.key}` |") and not row.endswith("|  |") for row in rows), field.key
