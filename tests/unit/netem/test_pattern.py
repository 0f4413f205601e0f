"""Patterns of links: what they mean and what is wrong with them."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gridpeers.netem.schema.pattern import Link, links_among, objections, parse
from tests.unit.netem.link_messages import MICROGRIDS, steady

NAMES = list(MICROGRIDS)
ENDS = [*NAMES, "plant"]


def meant(pattern: str) -> set[Link]:
    return {link for link in links_among(NAMES) if parse(pattern).matches(*link, MICROGRIDS)}


def pairs(left: list[str], right: list[str]) -> set[Link]:
    return {Link(src, dst) for src in left for dst in right if src != dst}


@pytest.mark.parametrize(("pattern", "links"), [
    ("inv4 -> inv7", pairs(["inv4"], ["inv7"])),
    ("inv4 <-> inv7", pairs(["inv4"], ["inv7"]) | pairs(["inv7"], ["inv4"])),
    ("MG1 -> MG2", pairs(NAMES[:3], NAMES[3:6])),
    ("mg1 <-> Mg1", pairs(NAMES[:3], NAMES[:3])),
    ("* -> inv2", pairs(NAMES, ["inv2"])),
    ("* <-> *", pairs(NAMES, NAMES)),
    ("plant -> inv2", pairs(["plant"], ["inv2"])),
    ("inv2 -> plant", pairs(["inv2"], ["plant"])),
    ("plant <-> *", pairs(["plant"], NAMES) | pairs(NAMES, ["plant"])),
    ("{inv1, MG2} <-> inv3", pairs(["inv1", *NAMES[3:6]], ["inv3"]) | pairs(["inv3"], ["inv1", *NAMES[3:6]])),
    ("{*, plant} -> inv2", pairs(ENDS, ["inv2"])),
    ("MG1->inv5", pairs(NAMES[:3], ["inv5"])),
])  # fmt: skip
def test_a_pattern_matches_these_links(pattern: str, links: set[Link]) -> None:
    """Names, microgrids in any case, sets, all agents, and the plant where it is named."""
    assert meant(pattern) == links
    assert objections(pattern, NAMES, MICROGRIDS) == []


side = st.one_of(
    st.sampled_from([*ENDS, "MG1", "MG3", "*"]),
    st.lists(st.sampled_from(NAMES), min_size=1).map(lambda n: f"{{{', '.join(n)}}}"),
)


@steady
@given(side, side)
def test_a_double_arrow_matches_both_directions(left: str, right: str) -> None:
    assert meant(f"{left} <-> {right}") == meant(f"{left} -> {right}") | meant(f"{right} -> {left}")


def test_patterns_match_an_agent_that_joins_later() -> None:
    """A spare inverter matches by its microgrid and by `*` as soon as it is known."""
    known = MICROGRIDS | {"inv10": "MG3"}

    assert parse("MG3 -> inv1").matches("inv10", "inv1", known)
    assert parse("* -> inv1").matches("inv10", "inv1", {})


@pytest.mark.parametrize(("pattern", "words"), [
    ("inv4 - inv7", ['"inv4 - inv7" names no links', 'write "inv4 <-> inv7"']),
    ("inv4 <- inv7", ["write the sender first"]),
    ("inv1 ->", ["is not a name"]),
    ("{INV1, inv2} -> inv3", ['there is no "INV1"', 'did you mean "inv1"?']),
    ("inv1 -> inv1", ["matches no link: both ends are inv1;", 'two different ends, e.g. "inv1 <-> *"']),
    ("plant -> {plant, plant}", ["matches no link: both ends are plant;", 'e.g. "plant <-> *"']),
])  # fmt: skip
def test_a_pattern_without_a_link_is_a_problem(pattern: str, words: list[str]) -> None:
    """The problem quotes the pattern and names the right form."""
    (text,) = objections(pattern, NAMES, MICROGRIDS)

    assert all(word in text for word in words), text


@pytest.mark.parametrize(("pattern", "agents", "words"), [
    ("plant <-> plant", None, "both ends are plant;"),
    ("MG1 -> *", ["inv1"], 'both ends are inv1; .* e.g. "inv1 <-> plant"'),
    ("inv1 -> inv1", None, ""),
    ("* -> *", [], "there is no inverter"),
])  # fmt: skip
def test_before_names_are_known_only_patterns_without_any_possible_link_are_refused(
    pattern: str, agents: list[str] | None, words: str
) -> None:
    """A microgrid may have the name of an inverter."""
    said = objections(pattern, agents, {"inv1": "MG1"})

    assert len(said) == bool(words)
    assert re.search(words, " ".join(said))
