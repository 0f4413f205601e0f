"""`gridpeers why` explains what happened to a decision, in numbers that add up to the step taken."""

from __future__ import annotations

from pathlib import Path

import pytest

from gridpeers.lab.explanation.explanation import Explanation, NeighbourAccount, explain
from gridpeers.lab.explanation.law_step import LawStep
from gridpeers.scenarios.record.record_reader import RunRecord
from tests.command_line import invoke
from tests.record.recorded_runs import recorded_run

ISLANDED = """
seed = 7
[time]
end_s = {end}
[[event]]
label = "event1"
t_s = 0.2
open = ["13-152"]
[case.case]
secondary = "all"
graph = "full"
"""


def run(tmp_path: Path, more: str = "", end: float = 0.8) -> RunRecord:
    """Run nine agents that island at 0.2 s, with more lines of a scenario."""
    (tmp_path / "it.toml").write_text(ISLANDED.format(end=end) + more, encoding="utf-8")
    return recorded_run(tmp_path / "it.toml", "case", tmp_path / "case")


def account(explanation: Explanation, name: str) -> NeighbourAccount:
    return next(each for each in explanation.neighbours if each.name == name)


def assert_adds_up(explanation: Explanation, *, named: bool = True) -> LawStep:
    """The set-points before, the terms and the limits give the recorded set-points after, within 1e-12 pu."""
    step, decision = explanation.step, explanation.decision
    assert step is not None
    assert step.problem == ""
    for of, before, after, base in zip(
        (step.P_set, step.V_set),
        decision.before,
        decision.after,
        (decision.config.P_rated, decision.config.V_nom),
        strict=True,
    ):
        total = before / base + sum(term.value for term in of.terms)
        assert min(max(total, of.low), of.high) == pytest.approx(after / base, rel=0.0, abs=1e-12)
        assert total + of.limits == pytest.approx(after / base, rel=0.0, abs=1e-12)
        assert {term.name for term in of.terms} != {"step"} or not named
    return step


FAULTS = """
[[link]]
on = "inv4 <-> inv7"
cut = true
from_s = 0.5
[[link]]
on = "inv2 -> *"
cut = true
from_s = 0.1
[[link]]
on = "inv8 -> inv4"
corrupt = { p = 1.0, checksum = false }
from_s = 0.5
[[node]]
name = "inv9"
kill = true
from_s = 0.5
"""


@pytest.fixture(scope="module")
def faulty(tmp_path_factory: pytest.TempPathFactory) -> RunRecord:
    """A run in which inverter 4 hears less and less."""
    return run(tmp_path_factory.mktemp("faulty"), FAULTS)


def test_a_link_cut(faulty: RunRecord) -> None:
    """The last state before the cut counts in full, at its age; the others are lost on the link, and counted."""
    explanation = explain(faulty, "inv4", 0.7)

    step = assert_adds_up(explanation)
    cut = account(explanation, "inv7")
    assert cut.input is not None
    assert (cut.used, cut.input.weight) == (True, 1.0)
    assert cut.input.age == pytest.approx(0.22)
    assert cut.why == "10 states since: 10 cut off by a cut link"
    assert {each.name for each in explanation.neighbours if not each.why} == {"inv1", "inv3", "inv5", "inv6"}
    assert {term.neighbour for term in step.P_set.terms} == {"", *(it.name for it in explanation.neighbours if it.used)}
    assert "10 states since: 10 cut off by a cut link" in str(explanation)


def test_an_agent_that_was_not_there(faulty: RunRecord) -> None:
    """A neighbour that has left is named with its last event; its own last decision is shown."""
    other, own = explain(faulty, "inv4", 0.7), explain(faulty, "inv9", 0.7)

    gone = account(other, "inv9")
    assert (gone.input, gone.used) == (None, False)
    assert gone.why.startswith("not met: ")
    assert "inv9" in gone.why
    assert own.t < 0.55
    assert own.aftermath[0].startswith("it is the last decision before 0.7 s: inv9 dies at t = 0.5 s")
    assert own.aftermath[1].startswith("at 0.7 s its inverter is on the network, delivers ")
    assert own.aftermath[1].endswith(" kW, and keeps these set-points")
    assert all(sentence in str(own) for sentence in own.aftermath)
    assert explain(faulty, "inv9", own.t + 0.01).aftermath == ()


def test_a_limit_hit(tmp_path: Path) -> None:
    """The part of the step that the limit takes back is a term of its own."""
    record = run(tmp_path, "[gains]\nP_set_max_pu = 0.68\n", end=0.4)

    explanations = [explain(record, "inv1", t) for t in (0.22, 0.24, 0.26, 0.28, 0.3)]
    hit = [each for each in explanations if each.step is not None and each.step.P_set.limits]

    assert hit
    for explanation in hit:
        step = assert_adds_up(explanation)
        assert step.P_set.limits < -1e-6
        assert step.P_set.after == 0.68
    assert "at its upper limit" in str(hit[0])


def test_an_island_change(tmp_path: Path) -> None:
    """After microgrid 1 becomes an island, other neighbours are left out, with both islands named."""
    record = run(tmp_path, '[[event]]\nlabel = "event2"\nt_s = 0.5\nopen = ["sw1_2"]\n', end=0.7)

    together, apart = explain(record, "inv4", 0.48), explain(record, "inv4", 0.66)

    for explanation in (together, apart):
        step, used = assert_adds_up(explanation), {each.name for each in explanation.neighbours if each.used}
        assert {term.neighbour for term in step.P_set.terms} == {"", *used}
    assert {each.why for each in together.neighbours} == {""}
    assert {each.name for each in apart.neighbours if not each.used} == {"inv1", "inv2", "inv3"}
    assert account(apart, "inv2").why == "in another island: inv1, not inv4"
    assert any(event.kind == "island" for event in apart.events)


def test_decisions_without_a_law(tmp_path: Path) -> None:
    """On hold while grid-connected, without secondary control, and at the first tick."""
    record, file = run(tmp_path), tmp_path / "none.toml"
    file.write_text(ISLANDED.format(end=0.8).replace('secondary = "all"', 'secondary = "none"'), encoding="utf-8")
    none = recorded_run(file, "case", tmp_path / "none")

    assert "secondary control was on hold while grid-connected" in str(explain(record, "inv1", 0.1))
    for t in (0.1, 0.7):
        text = str(explain(none, "inv1", t))
        assert "it has no secondary control in this case" in text
        assert "on hold" not in text
    first = explain(record, "inv1", 0.0)
    assert {each.why for each in first.neighbours} == {"no state yet: at its first tick an agent has heard nobody"}
    assert len(first.neighbours) == 8
    assert " pu from nominal" in str(first)


@pytest.mark.parametrize("law", ["dapi", "event-triggered"])
def test_published_laws(law: str, tmp_path: Path) -> None:
    """Each names its terms, and one with a memory is computed from its last start."""
    record = run(tmp_path, f'law = "{law}"\n', end=0.6)

    for agent in ("inv1", "inv2"):
        for t in (0.22, 0.4, 0.58):
            assert_adds_up(explain(record, agent, t))
    assert explain(record, "inv1", 0.1).step is None


@pytest.fixture(scope="module")
def islanded(tmp_path_factory: pytest.TempPathFactory) -> RunRecord:
    return run(tmp_path_factory.mktemp("why"))


def test_the_command(islanded: RunRecord) -> None:
    """It prints the explanation; no colours in a pipe."""
    code, printed = invoke("why", str(islanded.path), "inv4", "0.7")

    assert code == 0
    assert printed.startswith(str(explain(islanded, "inv4", 0.7)))
    assert "\x1b" not in printed


@pytest.mark.parametrize(("arguments", "complaint"), [
    (("inv77", "0.5"), "there was no agent inv77; agents are inv1-9"),
    (("plant", "0.5"), "there was no agent plant; agents are inv1-9"),
    (("inv4", "7"), "t = 7 s is outside of the record, which has 0 to 0.80 s"),
    (("inv4", "nan"), "needs a run time in s"),
    (("inv4", "0.5", "--case", "V"), 'it is the record of one case, and "V" is another one; leave --case out'),
])  # fmt: skip
def test_bad_input(arguments: tuple[str, ...], complaint: str, islanded: RunRecord) -> None:
    """One line has the problem and the valid names."""
    code, printed = invoke("why", str(islanded.path.parent), *arguments)

    assert code == 2
    assert complaint in printed
    assert printed.count("\n") == 1
