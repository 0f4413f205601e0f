"""Entries of a scenario: read, checked with all problems at once."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any, get_args

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gridpeers.netem.models.delay import AnyDelay, Lognormal, Normal, Trace
from gridpeers.netem.models.lie import AnyLie
from gridpeers.netem.models.loss import AnyLoss, Bernoulli, GilbertElliott
from gridpeers.netem.models.medium import Cut
from gridpeers.netem.schema.fault import KINDS, PROFILES, Fault
from gridpeers.netem.schema.netem import Netem
from gridpeers.netem.schema.partition import Partition
from gridpeers.netem.schema.pattern import Link, links_among
from gridpeers.netem.schema.trace_file import with_traces
from gridpeers.wire.schema.table_reading import read_table
from tests.unit.netem.link_messages import MICROGRIDS, steady

NAMES = list(MICROGRIDS)


def problems_of(text: str, end_s: float = 10.0) -> list[str]:
    """All problems of a TOML text, as "path: text"."""
    netem, form = read_table(Netem, tomllib.loads(text))
    noted = {problem.path for problem in form}
    return [": ".join(problem) for problem in form + netem.problems(NAMES, MICROGRIDS, end_s, noted)]


def _lying(keys: str, number: int = 3) -> str:
    return f'[[node]]\nname = "inv{number}"\nlies = {{{keys}}}'


def test_a_scenarios_entries_are_read_as_written() -> None:
    """Shorthands, models, profiles with a key of their own, partitions and nodes come out as structs."""
    text = """
    [[link]]
    on = "MG1 <-> MG2"
    profile = "lte"
    loss = 0.02
    from_s = 1
    [[link]]
    on = "plant -> inv2"
    delay = {model = "normal", mean_s = 0.1, std_s = 0.02, correlation = 0.5, fifo = true}
    cut = {hold = true}
    [[partition]]
    groups = [["inv1"], ["MG2", "inv9"]]
    [[node]]
    name = "inv3"
    skew = {factor = 1.0001}
    """
    netem, form = read_table(Netem, tomllib.loads(text))

    assert not form
    assert not netem.problems(NAMES, MICROGRIDS, 10.0)
    assert netem.links[0].models() == {"loss": Bernoulli(p=0.02), "delay": PROFILES["lte"].delay}
    assert netem.links[1].models() == {
        "cut": Cut(hold=True),
        "delay": Normal(mean_s=0.1, std_s=0.02, correlation=0.5, fifo=True),
    }
    assert msgspec.json.decode(msgspec.json.encode(netem), type=Netem) == netem


@pytest.mark.parametrize(("text", "path", "words"), [
    (_lying('model = "offset"'), "node[0].lies", ["changes nothing", "P_set_W"]),
    (_lying('model = "scale", Q = 1e9'), "node[0].lies.Q", ["-1e+06 to 1e+06"]),
    (_lying('model = "replay", delay_s = 2000'), "node[0].lies.delay_s", ["2 (2000 ms)"]),
    (_lying('model = "freeze", of = ["f"]'), "node[0].lies.of", ['a list with one of "P_set", "V_set", "Q"']),
    (_lying('model = "freeze", in_name_of = "inv3"'), "node[0].lies.in_name_of", ["inv3 is the liar"]),
    (_lying('model = "freeze"') + "\nkill = true", "node[0].lies", ["sends nothing"]),
    (
        _lying('model = "freeze", in_name_of = "inv1"') + "\n" + _lying('model = "freeze", in_name_of = "inv1"', 4),
        "node[1].lies.in_name_of",
        ["node[0]"],
    ),
])  # fmt: skip
def test_an_impossible_lie_is_a_problem_at_its_key(text: str, path: str, words: list[str]) -> None:
    """The only problem found, at its key; those of links, partitions and other nodes are in tests/golden/problems."""
    (found,) = problems_of(text)

    assert found.startswith(f"{path}: "), found
    assert all(word in found for word in words), found


@pytest.mark.parametrize(("first", "second", "clash"), [
    ({"on": "* -> inv2", "loss": 0.1}, {"on": "inv1 <-> *", "loss": 0.2}, True),
    ({"on": "* -> inv2", "loss": 0.1}, {"on": "inv1 <-> *", "delay": 0.2}, False),
    ({"on": "* -> inv2", "loss": 0.1}, {"on": "* -> inv3", "loss": 0.2}, False),
    ({"on": "* -> inv2", "loss": 0.1, "to_s": 2.0}, {"on": "* -> *", "loss": 0.2, "from_s": 2.0}, False),
    ({"on": "* -> inv2", "loss": 0.1, "to_s": 2.1}, {"on": "* -> *", "loss": 0.2, "from_s": 2.0}, True),
    ({"on": "MG1 -> MG2", "profile": "lte"}, {"on": "inv1 -> inv4", "delay": 0.1}, True),
    ({"on": "MG1 -> MG2", "cut": True}, {"on": "inv1 -> inv4", "cut": Cut(hold=True), "from_s": 5.0}, True),
])  # fmt: skip
def test_two_entries_of_one_kind_on_one_link_at_one_time_contradict_each_other(
    first: dict[str, Any], second: dict[str, Any], clash: bool
) -> None:
    """Only entries of equal link, time and kind are a problem, which names the link and the other entry."""
    found = Netem(links=(Fault(**first), Fault(**second))).problems(NAMES, MICROGRIDS, 10.0)

    assert [problem.path.partition(".")[0] for problem in found] == ["link[1]"] * clash
    assert all("link[0] gives inv1 -> inv" in problem.text for problem in found)


@pytest.mark.parametrize(("partition", "groups"), [
    (Partition(by="microgrid"), [NAMES[:3], NAMES[3:6], NAMES[6:]]),
    (Partition(by="halves"), [NAMES[:5], NAMES[5:]]),
    (Partition(alone="inv4"), [["inv4"], [name for name in NAMES if name != "inv4"]]),
    (Partition(groups=(("MG1",), ("inv4", "inv5"))), [NAMES[:3], NAMES[3:5], NAMES[5:]]),
    (Partition(groups=(("MG1", "plant"),)), [[*NAMES[:3], "plant"], NAMES[3:]]),
])  # fmt: skip
def test_a_partition_cuts_exactly_the_links_between_its_groups(partition: Partition, groups: list[list[str]]) -> None:
    """Agents hear each other within a group and not across groups; the plant hears all unless it is in a group."""
    group = {name: i for i, names in enumerate(groups) for name in names}
    for src, dst in links_among(NAMES):
        apart = src in group and dst in group and group[src] != group[dst]
        assert bool(partition.spans(src, dst, MICROGRIDS)) == apart


def test_a_partition_by_island_follows_the_switches() -> None:
    """Nothing is cut while there is one island; after the split, links between islands are cut."""
    timeline = [(0.0, dict.fromkeys(NAMES, "grid")), (2.0, MICROGRIDS), (4.0, dict.fromkeys(NAMES, "inv1"))]
    netem = Netem(partitions=(Partition(by="island", from_s=1.0),)).over(timeline)

    assert [(s.from_s, s.to_s) for s in netem.spans(Link("inv1", "inv4"), MICROGRIDS)] == [(2.0, 4.0)]
    assert netem.spans(Link("inv1", "inv2"), MICROGRIDS) == ()


@pytest.mark.parametrize("name", PROFILES)
def test_a_profile_is_plausible_and_names_its_source(name: str) -> None:
    """Every profile passes the checks of a user's numbers, and names its source or its assumptions."""
    fault = Fault(on="* <-> *", profile=name)

    assert not Netem(links=(fault,)).problems(NAMES, MICROGRIDS, 10.0)
    assert "assumed" in PROFILES[name].source or "et al." in PROFILES[name].source


@steady
@given(
    st.builds(
        Fault,
        on=st.just("* -> *"),
        delay=st.one_of(
            st.none(), st.floats(0.0, 9.0), st.builds(Lognormal, median_s=st.floats(0.001, 1), sigma=st.floats(0.01, 2))
        ),
        loss=st.one_of(st.none(), st.floats(0, 1), st.builds(GilbertElliott, p=st.floats(0, 1), r=st.floats(0.001, 1))),
        cut=st.sampled_from([None, True, Cut(hold=True)]),
    )
)
def test_plausible_faults_have_no_problem_and_reach_an_agent_unchanged(fault: Fault) -> None:
    """Numbers within their ranges pass, and the agent's configuration equals the file."""
    assert fault.problems() == [] or fault.models() == {}
    assert msgspec.json.decode(msgspec.json.encode(fault), type=Fault) == fault


def test_a_traces_file_is_read_from_the_scenarios_folder(tmp_path: Path) -> None:
    """The column delay_s becomes the trace, other columns and empty lines are free."""
    (tmp_path / "delays.csv").write_text("t_s, delay_s\n0,0.01\n\n1,0.02\n")
    netem, wrong = with_traces(Netem(links=(Fault(on="* -> *", delay=Trace(file="delays.csv")),)), tmp_path)

    assert not wrong
    assert netem.links[0].models()["delay"].delays_s == (0.01, 0.02)
    assert not netem.problems(NAMES, MICROGRIDS, 10.0)


def test_a_trace_with_decimal_commas_has_its_delays(tmp_path: Path) -> None:
    """In one column without a separator, 0,012 is 12 ms and not 0 s."""
    (tmp_path / "d.csv").write_bytes("delay_s\r\n0,012\r\n0,5\r\n".encode("utf-16"))

    netem, wrong = with_traces(Netem(links=(Fault(on="* -> *", delay=Trace(file="d.csv")),)), tmp_path)

    assert not wrong
    assert netem.links[0].models()["delay"].delays_s == (0.012, 0.5)


@pytest.mark.parametrize(("rows", "words"), [
    (
        "delay_s\n0.01\nabc\n-0.1\n20\n",
        ['row 3: delay_s must be a number of seconds, got "abc"', "row 4:", "row 5: 20 s"],
    ),
    ("delay\n0.01\n", ['no column "delay_s"']),
    ("delay_s\n12\n13\n", ["are they in milliseconds?"]),
    ("delay_s\n", ["no row"]),
    ("t_s,delay_s\n0,1,0,012\n", ["row 2: 4 cells, but the header has 2"]),
    ("delay_s\n" + "x\n" * 30, [*[f"row {i}:" for i in range(2, 22)], "10 more rows"]),
    (None, ["there is no file"]),
])  # fmt: skip
def test_bad_rows_of_a_trace_are_named(tmp_path: Path, rows: str | None, words: list[str]) -> None:
    """Each problem has its row; a whole file in milliseconds is one problem."""
    if rows is not None:
        (tmp_path / "d.csv").write_text(rows)
    _, wrong = with_traces(Netem(links=(Fault(on="* -> *", delay=Trace(file="d.csv")),)), tmp_path)

    assert {problem.path for problem in wrong} == {"link[0].delay.file"}
    assert len(wrong) == len(words)
    assert all(word in problem.text for word, problem in zip(words, wrong, strict=True))


TEXT = (Path(__file__).parents[3] / "docs" / "reference" / "link-faults.md").read_text(encoding="utf-8")


def test_the_page_has_every_model_with_its_keys_every_kind_and_every_profile() -> None:
    """No name of a scenario file is missing from the tables of docs/reference/link-faults.md."""
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
