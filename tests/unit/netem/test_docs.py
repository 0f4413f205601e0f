"""The documentation of links says what is so."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import get_args

import msgspec

from gridpeers.netem.models.delay import AnyDelay
from gridpeers.netem.models.lie import AnyLie
from gridpeers.netem.models.loss import AnyLoss
from gridpeers.netem.schema.fault import KINDS, PROFILES
from gridpeers.netem.schema.netem import Netem
from gridpeers.wire.schema.table_reading import read_table
from tests.unit.netem.link_messages import MICROGRIDS

TEXT = (Path(__file__).parents[3] / "docs" / "netem.md").read_text(encoding="utf-8")


def test_the_example_is_a_scenario_without_a_problem() -> None:
    """The example of the page is a valid scenario and does what the page says."""
    (example,) = re.findall(r"```toml\n(.*?)```", TEXT, flags=re.S)
    netem, form = read_table(Netem, tomllib.loads(example))

    assert not form
    assert not netem.problems(list(MICROGRIDS), MICROGRIDS, 10.0)
    assert (len(netem.links), len(netem.partitions), len(netem.nodes)) == (2, 1, 2)


def test_every_model_with_its_keys_every_kind_and_every_profile_is_told_of() -> None:
    """Nothing that a scenario may say is missing from the tables."""
    for model in (*get_args(AnyDelay), *get_args(AnyLoss), *get_args(AnyLie)):
        (row,) = re.findall(rf"^\| `{model.__struct_config__.tag}` \|.*$", TEXT, flags=re.M)
        keys = {field.encode_name for field in msgspec.structs.fields(model)} - {
            "fifo",
            "correlation",
            "delays_s",
            "in_name_of",
            "plant",
        }
        assert {key for key in keys if f"`{key}`" not in row} == set()
    assert all(f"`{kind}`" in TEXT for kind in KINDS)
    assert all(f"| `{name}` |" in TEXT for name in PROFILES)
