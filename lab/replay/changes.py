"""What a counterfactual changes: links, the law, and other keys of agents and links, from a time on."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path
from typing import Any, TypeVar

from msgspec.structs import replace

from gridpeers.agents.agent_config import Control
from gridpeers.lab.replay.recorded_process import ReplayError, require_arrivals
from gridpeers.netem.schema.fault import Fault
from gridpeers.netem.schema.netem import Netem
from gridpeers.netem.schema.partition import Partition
from gridpeers.netem.schema.pattern import objections
from gridpeers.plant.equipment import Tables
from gridpeers.scenarios.emulation.link_data import EmulationConfig
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.scenarios.schema.configs import configs
from gridpeers.scenarios.schema.loading import check_tables
from gridpeers.scenarios.schema.participants import netem_of, setup_of
from gridpeers.scenarios.schema.scenario_errors import Problems, ScenarioError
from gridpeers.scenarios.schema.scenario_model import AS_RUN, ScenarioModel
from gridpeers.scenarios.schema.scenario_writing import to_toml
from gridpeers.scenarios.sweep.paths import PathError, Tree, put, steps
from gridpeers.wire.wording import suggestion

OF_CASE = ("secondary", "graph", "links", "without")  # Keys of a case that agents have

OF_BOTH = ("law", "gains", "degraded_communication", "link", "partition")
"""Keys of agents and links that a case may have, and the whole scenario."""

Entry = TypeVar("Entry", Fault, Partition)


@dataclass(frozen=True, kw_only=True)
class Changes:
    without: tuple[str, ...] = ()
    law: str = ""
    keys: Mapping[str, Any] = field(default_factory=dict)
    since: float = 0.0

    def __bool__(self) -> bool:
        return bool(self.without or self.law or self.keys)

    def __str__(self) -> str:
        parts = [f"without {pattern}" for pattern in self.without]
        parts += [f"law {self.law}"] * bool(self.law)
        parts += [f"{key} = {value}" for key, value in self.keys.items()]
        if not parts:
            return "nothing changed"
        return ", ".join([*parts, *([f"from {self.since:g} s on"] if self.since > 0.0 else [])])


@dataclass(frozen=True, kw_only=True)
class ChangedRule:
    recorded: ScenarioModel
    scenario: ScenarioModel
    """The scenario as changed, links too; the title of its case says what is changed."""
    links_written: bool
    feeder: Tables
    case: str
    control: Control | None
    """Rule of control of every agent, from the start; None keeps that of the record."""
    links: dict[str, Any] | None
    """Configuration of the emulated links, of the whole run; None keeps that of the record."""
    changes: Changes

    def unwritten(self, *, clock: str) -> Iterator[str]:
        if not self.links_written:
            yield "The changes of links are not in this file: their entries would contradict others."
        if clock == "realtime":
            yield "Not in this file: delays and losses on the wire, and commands of people."


def changed_rule(record: RunRecord, changes: Changes) -> ChangedRule:
    """Return a record's run under changes; ReplayError with all that is wrong with these, or with the record."""
    require_arrivals(record)
    simulator, bridged = record.info.plant.settings.simulator, record.info.plant.bridged
    if simulator != "gridpeers" or bridged:
        raise ReplayError(
            f"{record.path}: its plant was {'a federate' if bridged else f'that of {simulator}'}, which "
            "cannot run again; a counterfactual needs gridpeers' own plant"
        )
    before, feeder = _checked(record, _tables(record), frozenset())
    case, since = record.info.case, changes.since
    microgrids = {row.name: row.microgrid for row in (*feeder.inverters, *feeder.spares)}
    wrong = [text for pattern in changes.without for text in objections(pattern, tuple(microgrids), microgrids)]
    if not isfinite(since) or not 0.0 <= since < record.t_end:
        wrong.append(f"from {since:g} s: is outside of the record, which has 0 to {record.t_end:.2f} s")
    tables, changed = _tables(record), []
    for path, value in {**({"law": changes.law} if changes.law else {}), **changes.keys}.items():
        try:
            changed.append(_put(tables, case, path, value, whole=path == "law" and bool(changes.law)))
        except (PathError, ValueError) as error:
            wrong.append(f"{path}: {error}")
    if wrong:
        raise ReplayError(*wrong)
    after, _ = _checked(record, tables, frozenset(changed))
    netem_before, netem_after = (
        setup_of(netem_of(scenario, case), scenario, feeder, real_nodes=True).netem for scenario in (before, after)
    )
    netem = spliced(netem_before, netem_after, since)
    if changes.without:
        cuts = (Fault(on=pattern, cut=True, from_s=since) for pattern in changes.without)
        netem = replace(netem, links=(*netem.links, *cuts))
    control, as_it_was = (configs(scenario, feeder, case)[1][0].control for scenario in (after, before))
    if control != as_it_was and since > 0.0:
        raise ReplayError(
            "the law, its gains and the graph change from the start of the run only: leave the time out; links can "
            "change at any time"
        )
    written = after if netem == netem_before else _written(record, _with_links(after, case, netem))
    title = f"what would have been, {changes}" if changes else after.cases[case].title
    scenario = written or after
    return ChangedRule(
        recorded=before,
        scenario=replace(scenario, cases={case: replace(scenario.cases[case], title=title)}),
        links_written=written is not None,
        feeder=feeder,
        case=case,
        control=None if control == as_it_was else control,
        links=None if netem == netem_before else _setup(record, after, feeder, netem),
        changes=changes,
    )


# -------------------------------------------------------------------- the scenario


def _tables(record: RunRecord) -> Tree:
    info = record.info
    if not info.toml:
        raise ReplayError(f"{record.path}: it has no scenario, so nothing in it can be changed")
    try:
        tables = tomllib.loads(info.toml)
        tables["case"] = {info.case: tables["case"][info.case]}
    except (ValueError, KeyError, RecursionError) as error:
        raise ReplayError(f"{record.path}: its scenario cannot be read: {error}") from None
    return {key: value for key, value in tables.items() if key not in (AS_RUN, "paper", "claims")}


def _checked(record: RunRecord, tables: Tree, changed: frozenset[str]) -> tuple[ScenarioModel, Tables]:
    problems = Problems(f"scenario of {record.path}", "", changed=changed)
    try:
        scenario, feeder = check_tables(tables, Path("scenario.toml").absolute(), problems)
        problems.raise_if_any()
    except ScenarioError as error:
        raise ReplayError(*(text.removeprefix("replace: ") for text in error.problems)) from None
    assert feeder is not None
    return scenario, feeder


def _written(record: RunRecord, scenario: ScenarioModel) -> ScenarioModel | None:
    """Return a scenario if its file can be read again; None if its entries contradict each other."""
    try:
        _checked(record, tomllib.loads(to_toml(scenario, {})), frozenset())
    except ReplayError:
        return None
    return scenario


def _put(tables: Tree, case: str, path: str, value: Any, *, whole: bool) -> str:
    """Set a key of agents or links, and return its path from the top; ValueError if it is a key of something else."""
    way = [str(step) for step in steps(path)]
    own = tables["case"][case]
    prefix = f"case.{case}."
    if way[:1] == ["case"]:
        if way[1:2] != [case]:
            raise ValueError(f"the record is of case {case}")
        path, way = path.removeprefix(prefix), way[2:]
    first = way[0] if way else ""
    if first not in (*OF_CASE, *OF_BOTH):
        raise ValueError(f"is not a key of agents or links; {suggestion(first, (*OF_BOTH, *OF_CASE), 'keys')}")
    if first in OF_CASE or own.get(first) or whole:
        put(own, path, value)
        return prefix + path
    put(tables, path, value)
    return path


# -------------------------------------------------------------------- links


def spliced(before: Netem, after: Netem, since: float) -> Netem:
    """Return the faults of one configuration up to a time (s), and those of another one from then on."""
    if before == after or since <= 0.0:
        return after
    return replace(
        before,
        links=_spliced(before.links, after.links, since),
        partitions=_spliced(before.partitions, after.partitions, since),
    )


def _spliced(before: tuple[Entry, ...], after: tuple[Entry, ...], since: float) -> tuple[Entry, ...]:
    found = [entry for entry in before if entry in after]
    for entry in before:
        if entry not in after and entry.from_s < since:
            until = since if entry.to_s is None else min(entry.to_s, since)
            found.append(replace(entry, to_s=until))
    for entry in after:
        if entry not in before and (entry.to_s is None or entry.to_s > since):
            found.append(replace(entry, from_s=max(entry.from_s, since)))
    return tuple(found)


def _with_links(scenario: ScenarioModel, case: str, netem: Netem) -> ScenarioModel:
    common = replace(scenario.netem, links=(), partitions=())
    own = replace(scenario.cases[case].netem, links=netem.links, partitions=netem.partitions)
    return replace(scenario, netem=common, cases={case: replace(scenario.cases[case], netem=own)})


def _setup(record: RunRecord, scenario: ScenarioModel, feeder: Tables, netem: Netem) -> dict[str, Any]:
    was = record.info.plant.links
    setup = EmulationConfig.of_tree(was) if was else setup_of(netem, scenario, feeder, real_nodes=True)
    nodes = setup.netem.nodes if was else ()
    return replace(setup, netem=replace(netem, nodes=nodes)).to_tree()
