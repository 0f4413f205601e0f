"""The pages made from the code: nothing undocumented, no unit forgotten."""

import re
import typing
from pathlib import Path
from typing import get_args

import msgspec
import pytest

from gridpeers.agents.agent_config import DegradedCommunication, Gains
from gridpeers.cli.commands.show import Topic
from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem, NodeFault
from gridpeers.netem.schema.partition import Partition
from gridpeers.plant.inverters.gfl import Gfl
from gridpeers.plant.inverters.gfm_droop import GfmDroop
from gridpeers.plant.plant_config import Protection, SyncCheck
from gridpeers.scenarios.reference import TOPICS, field_docs, page
from gridpeers.scenarios.schema.scenario_model import Case, Event, PlantTable, Processes, ScenarioModel, Time
from gridpeers.wire import keys, messages
from gridpeers.wire.schema.table_schema import NamedTables, fields_of

DOCS = Path(__file__).parents[3] / "docs"
TABLES: tuple[type[msgspec.Struct], ...] = (
    ScenarioModel,
    Time,
    PlantTable,
    GfmDroop,
    Gfl,
    Gains,
    Processes,
    Event,
    Case,
)


@pytest.mark.parametrize("cls", [*TABLES, *typing.get_args(messages.AnyMessage), messages.PlantEvent])
def test_every_field_has_its_sentence(cls: type[msgspec.Struct]) -> None:
    """A field without one, in its annotation or below it, would have an empty line in the reference."""
    below = {name: text for name, (_, text) in field_docs(cls).items()}

    assert [field.name for field in fields_of(cls) if not (field.help or below[field.name])] == []


@pytest.mark.parametrize("cls", [Gains, DegradedCommunication, Protection, GfmDroop, Gfl, SyncCheck])
def test_the_unit_in_a_key_is_the_one_in_its_sentence(cls: type[msgspec.Struct]) -> None:
    """T_p_s is in seconds, and its docstring says so; what is in s, pu or Hz carries it in the key."""
    below = {name: text for name, (_, text) in field_docs(cls).items()}
    units = {field.name: re.search(r"\((s|pu|Hz)\)", field.help or below[field.name]) for field in fields_of(cls)}

    for field in fields_of(cls):
        unit = field.key.removeprefix(f"{field.name}_") if field.key != field.name else None
        found = units[field.name]
        if unit is not None:
            expected = unit if found is None else found[1]
            assert unit == expected, field.name
        elif not field.name.startswith(("k_", "F_")):
            assert found is None, f"{field.name} is in {found and found[1]}, which its key does not say"


def test_every_key_of_a_scenario_is_on_its_page() -> None:
    """The page names each key with its unit; tables have sections of their own."""
    text = page("scenario")

    for cls in (*TABLES, Fault, Partition, NodeFault):
        for field in fields_of(cls):
            key = field.key
            if key == "own":
                key = '"mine:Name"'
            if field.type is Netem:  # written as the entries, which have sections of their own
                continue
            if named := field.mark(NamedTables):
                assert all(f"## [plant.{name}]" in text for name in named.known())
                continue
            assert any(form in text for form in (f"`{key}`", f"[{key}", f".{key}]", f".{key}.")), (cls, key)


def test_every_message_and_every_key_is_on_its_page() -> None:
    """The reference lists the messages that can be sent, and their keys."""
    of_messages, of_keys = page("messages"), page("keys")

    assert all(f"## {kind.__name__}" in of_messages for kind in typing.get_args(messages.AnyMessage))
    assert all(f"`{spec.expression}`" in of_keys for spec in keys.KEY_SPECS)


@pytest.mark.parametrize("topic", TOPICS)
def test_pages_are_plain_tables(topic: str) -> None:
    """Every row of a table has as many cells as its header."""
    widths: list[int] = []
    for line in page(topic).splitlines():
        if not line.startswith("|"):
            widths = []
            continue
        widths.append(len(re.findall(r"(?<!\\)\|", line)))
        assert widths[-1] == widths[0], line


def test_the_page_on_keys_has_the_reference() -> None:
    """The site puts what `gridpeers doc scenario` prints in place of this marker."""
    assert "<!-- generated: doc scenario -->" in (DOCS / "reference/scenario-keys.md").read_text(encoding="utf-8")


def test_the_command_has_every_page() -> None:
    """Its list is written apart, as help comes without what makes the pages."""
    assert set(get_args(Topic)) == set(TOPICS)
