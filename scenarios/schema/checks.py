"""Relations between the keys of a scenario, and between them and the feeder."""

from __future__ import annotations

import math
import re
import unicodedata
from itertools import pairwise

from gridpeers.plant.equipment import InverterRow, Tables
from gridpeers.plant.inverters.inverter_model import InverterModel
from gridpeers.plant.inverters.inverter_registry import PUBLISHED_SETS, foreign, given
from gridpeers.plant.known_names import DEFAULTS, defaults
from gridpeers.scenarios.schema.participants import inverters_of
from gridpeers.scenarios.schema.scenario_errors import Problems, multiple
from gridpeers.scenarios.schema.scenario_model import InverterTable, ScenarioModel
from gridpeers.wire.plugins.plugin import plugin_of
from gridpeers.wire.schema.table_reading import keys_of
from gridpeers.wire.schema.table_schema import contradictions
from gridpeers.wire.wording import suggestion

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,30}")
"""Names become folders and, two of them joined, a part of a key of at most 64 letters."""

TRIPS = "protection.trips"

LONGEST_CLEARING_TIME = 3600.0

_RUN_FOLDER = ("log", "plots", "metrics.json", "report.txt", "scenario.toml", "status.txt")
"""Files and folders of a run folder beside the folders of its cases."""


def name_of(stem: str) -> str:
    """Return the name of a scenario whose file has none: the file's, with other letters as names may have."""
    letters = unicodedata.normalize("NFKD", stem).encode("ascii", "ignore").decode("ascii")
    return re.sub(r"[^A-Za-z0-9_.]+", "-", letters).strip("_.-")[:31] or "scenario"


def check_names(scenario: ScenarioModel, problems: Problems) -> None:
    for path, name in [
        ("name", scenario.name),
        *((f"case.{case}", case) for case in scenario.cases),
        *((f"event[{i}].label", event.label) for i, event in enumerate(scenario.events)),
    ]:
        if not problems.touch(path) and not _NAME.fullmatch(name):
            problems.add(path, f'name "{name}" must be up to 31 letters, digits, "_", "-" or ".", as it names files')
    labels = [event.label for event in scenario.events]
    for i, label in enumerate(labels):
        if label in labels[:i]:
            problems.add(
                f"event[{i}].label", f'event "{label}" exists already; a label names one window of measurement'
            )
        elif label == "history_sha256":
            problems.add(f"event[{i}].label", "this name is taken by a key of metrics.json; choose another")
    if not scenario.cases and not problems.touch("case"):
        problems.add("case", "there is no case; write at least one table [case.NAME]")


def check_start(scenario: ScenarioModel, feeder: Tables, problems: Problems) -> None:
    """Note first set-points that an inverter cannot give: the start would be no equilibrium."""
    plant, P, V = scenario.plant, scenario.plant.P_set0_pu, scenario.plant.V_set0_pu
    if problems.touch("plant.gfm", "plant.gfl"):
        return
    P_known, V_known = (not problems.touch(f"plant.{key}") for key in ("P_set0_pu", "V_set0_pu"))
    alike: dict[tuple[str, InverterModel], list[InverterRow]] = {}
    for row in feeder.inverters:
        alike.setdefault((row.kind, feeder.parameters_of(row, plant.gfm, plant.gfl)), []).append(row)
    for (kind, parameters), units in sorted(alike.items(), key=lambda item: item[0][0], reverse=True):
        table, common = f"plant.{kind.lower()}", getattr(plant, kind.lower())
        names = ", ".join(row.name for row in units)
        for name in parameters.LIMITS_OF_P:
            limit, below = getattr(parameters, name), name.endswith("_min")
            key = f"{table}.{name}_pu" if limit == getattr(common, name, None) else f"{name}_pu of {names}"
            right = limit <= P if below else limit >= P
            if right or not P_known or problems.touch(key):
                continue
            kW = ", ".join(f"{row.name} {P * row.P_rated / 1e3:g} of {limit * row.P_rated / 1e3:g}" for row in units)
            problems.add(
                "plant.P_set0_pu",
                f"{P:g} pu is {'below' if below else 'above'} {key} = {limit:g} pu, so the start is no equilibrium "
                f"({kW} kW); {'raise' if below else 'lower'} P_set0_pu, or change {key.removeprefix('plant.')}",
            )
            break
        low, high = parameters.V_set_min, parameters.V_set_max
        if V_known and not low <= V <= high:
            where = table if (low, high) == (common.V_set_min, common.V_set_max) else names
            problems.add(
                "plant.V_set0_pu",
                f"{V:g} pu is beyond {where}.V_set_min_pu = {low:g} to V_set_max_pu = {high:g}, which limit every "
                "later set-point; choose it within, or change them",
            )


def check_cases(scenario: ScenarioModel, inverters: tuple[str, ...], problems: Problems) -> None:
    for name, case in scenario.cases.items():
        if name in _RUN_FOLDER:
            problems.add(f"case.{name}", f"a case names a folder beside {', '.join(_RUN_FOLDER)}; choose another name")
        if inverters:
            _check_links(f"case.{name}.without", case.without, inverters, problems)
        path = f"case.{name}.links"
        if problems.touch(path, f"case.{name}.graph"):
            continue
        graph = plugin_of(case.graph).use
        if graph == "links" and not case.links:
            problems.add(f"case.{name}.graph", 'graph "links" needs the key links, e.g. links = [["inv1", "inv4"]]')
        if graph != "links" and case.links:
            problems.add(path, f'links are listed, but the graph is "{graph}"; write graph = "links"')
        if inverters:
            _check_links(path, case.links, inverters, problems)


def check_events(scenario: ScenarioModel, problems: Problems) -> None:
    keys = ("open", "close", "leave", "join", "P_max_kW", "load")
    for i, event in enumerate(scenario.events):
        if not any(getattr(event, key) for key in keys) and not problems.touch(*(f"event[{i}].{key}" for key in keys)):
            problems.add(
                f"event[{i}]", f'event "{event.label}" does nothing; give it {", ".join(keys)}, e.g. open = ["13-152"]'
            )
        if event.synchronised and not event.close and not problems.touch(f"event[{i}].close"):
            problems.add(
                f"event[{i}].synchronised",
                f'event "{event.label}" closes no switch that could wait for synchronism; give it close',
            )
    labels = [event.label for event in scenario.events]
    for name, case in scenario.cases.items():
        for label in case.P_max_kW:
            problems.unknown(f"case.{name}.P_max_kW", "event", label, labels)


_MOVES = {
    "open": (False, "is open already", "close it before"),
    "close": (True, "is closed already", "open it before"),
    "leave": (False, "is not in the run", "let it join before"),
    "join": (True, "is in the run already", "let it leave before"),
}
"""Keys of an event that move switches or agents: the state after it, words for that state before it, and the remedy."""


def check_moves(scenario: ScenarioModel, feeder: Tables, problems: Problems) -> None:
    """Note unknown switches and agents in events, and those that are already where an event moves them."""
    switches = {name: switch.name for switch in feeder.switches for name in switch.names}
    names_shown = [switch.alias or switch.name for switch in feeder.switches]
    buses = {bus.name for bus in feeder.buses}
    inverters = [row.name for row in (*feeder.inverters, *feeder.spares)]
    there = {("switch", switch.name) for switch in feeder.switches if switch.closed}
    there |= {("agent", row.name) for row in feeder.inverters}
    for i, event in enumerate(scenario.events):
        if event.leave or event.join:
            rule = "the period at which agents leave and join"
            multiple(f"event[{i}].t_s", event.t_s, "time.T_c_s", scenario.time.T_c_s, rule, problems)
        moved: set[tuple[str, str]] = set()
        for key, (into, state, remedy) in _MOVES.items():
            path, is_switch = f"event[{i}].{key}", key in ("open", "close")
            for name in getattr(event, key):
                if is_switch and name not in switches:
                    strange = [end for end in name.split("-") if end[:1].isdigit() and end not in buses]
                    why = f" (there is no bus {' and no bus '.join(strange)})" if strange else ""
                    problems.add(path, f'no switch "{name}"{why}; {suggestion(name, names_shown, "switches")}')
                    continue
                if not is_switch and problems.unknown(path, "inverter", name, inverters):
                    continue
                which = ("switch", switches[name]) if is_switch else ("agent", name)
                word = f'switch "{name}"' if is_switch else f'"{name}"'
                if which in moved:
                    problems.add(path, f'{word} is named twice in event "{event.label}"; name it once')
                elif (which in there) == into:
                    problems.add(path, f"{word} {state} at {event.t_s:g} s; leave it out, or {remedy}")
                moved.add(which)
                (there.add if into else there.discard)(which)


def check_limits(scenario: ScenarioModel, feeder: Tables, problems: Problems) -> None:
    rows, plant = {row.name: row for row in inverters_of(scenario, feeder)}, scenario.plant
    limits = [(f"event[{i}].P_max_kW", event.P_max_kW) for i, event in enumerate(scenario.events)]
    for case, rule in scenario.cases.items():
        limits += [(f"case.{case}.P_max_kW.{label}", powers) for label, powers in rule.P_max_kW.items()]
    for path, name, kW in [(path, name, kW) for path, powers in limits for name, kW in powers.items()]:
        if problems.unknown(path, "inverter", name, rows):
            continue
        row = rows[name]
        parameters = feeder.parameters_of(row, plant.gfm, plant.gfl)
        most = row.P_rated * getattr(parameters, "P_max", 0.0) / 1e3
        if row.kind == "GFM":
            following = ", ".join(other.name for other in rows.values() if other.kind == "GFL")
            problems.add(
                path,
                f"{name} is grid-forming, so the network decides its power; only a grid-following inverter can be "
                f"limited: {following or 'there is none'}",
            )
        elif not math.isfinite(kW) or kW < 0.0 or kW > most * (1.0 + 1e-9):
            hint = f"; it is in kW: write {kW / 1e3:g}" if kW > most and kW / 1e3 <= most else ""
            problems.add(path, f"the available power of {name} is from 0 to {most:g} kW, got {kW:g} kW{hint}")


def check_changes(scenario: ScenarioModel, feeder: Tables, problems: Problems) -> None:
    rows = {row.name: row for row in (*feeder.inverters, *feeder.spares)}
    for name, table in scenario.plant.inverter.items():
        path = f"plant.inverter.{name}"
        if problems.unknown(path, "inverter", name, rows):
            continue
        kind, sets = rows[name].kind, PUBLISHED_SETS
        if table == InverterTable() and not problems.below(path):
            problems.add(
                path, f"changes nothing; give it one of {', '.join(keys_of(InverterTable))}, or a key of {kind}"
            )
        for text in foreign(given(table.own), kind):
            key, _, word = text.partition(" = ")
            what = f"{key} {word}" if word else "such parameter"
            problems.add(f"{path}.{key}", f"a {kind} has no {what}; {name} takes those of [plant.{kind.lower()}]")
        if table.parameters and not problems.unknown(f"{path}.parameters", "parameter set", table.parameters, sets):
            for key in foreign(sets[table.parameters], kind):
                problems.add(
                    f"{path}.parameters", f'set "{table.parameters}" has {key}, which is no parameter of a {kind}'
                )
    for row in rows.values():
        _check_own(row, scenario, feeder, problems)


def check_protection(scenario: ScenarioModel, f_nom: float, problems: Problems) -> None:
    given = scenario.protection.trips
    if problems.touch("protection", TRIPS):
        return
    names = DEFAULTS["III"]
    for name, (threshold, time) in given.items():
        if name not in names:
            problems.add(TRIPS, f'no trip function "{name}"; {suggestion(name, names, "functions")}')
            continue
        nominal, unit = (f_nom, "Hz") if name[1] == "F" else (1.0, "pu")
        low, high = (nominal, 2.0 * nominal) if name[0] == "O" else (0.0, nominal)
        if not low < threshold < high:
            problems.add(TRIPS, f"{name} must be between {low:g} and {high:g} {unit}, got {threshold:g} {unit}")
        if not 0.0 < time <= LONGEST_CLEARING_TIME:
            problems.add(
                TRIPS,
                f"{name}: the clearing time must be above 0 and at most {LONGEST_CLEARING_TIME:g} s, got {time:g} s",
            )
    if problems.touch(TRIPS) or scenario.protection.category == "off":
        return
    in_force = defaults(scenario.protection.category, f_nom) | given
    for kind in ("OV", "UV", "OF", "UF"):
        (first, _), (second, _) = in_force[f"{kind}1"], in_force[f"{kind}2"]
        if second < first if kind[0] == "O" else second > first:
            unit = "Hz" if kind[1] == "F" else "pu"
            problems.add(
                TRIPS,
                f"{kind}2 = {second:g} {unit} must be farther from nominal than {kind}1 = {first:g} {unit}; "
                f"set both, or leave {kind}2 as it is",
            )


def _check_own(row: InverterRow, scenario: ScenarioModel, feeder: Tables, problems: Problems) -> None:
    plant, path = scenario.plant, f"plant.inverter.{row.name}"
    own = row.parameters or row.own
    if not own or problems.touch("plant.gfm", "plant.gfl", path, f"{path}.parameters") or problems.below(path):
        return
    table = f"plant.{row.kind.lower()}"
    parameters = feeder.parameters_of(row, plant.gfm, plant.gfl)
    for key in foreign(PUBLISHED_SETS.get(row.parameters, {}) | row.own, row.kind, type(parameters)):
        problems.add(path, f"its model {parameters.model} has no {key}; leave it out, or name another model")
    for key, text in contradictions(type(parameters), parameters):
        if not problems.touch(f"{table}.{key}"):
            problems.add(
                f"{path}.{key}", f"{text}; the values come from [{table}], its published set and its own table"
            )


def _check_links(path: str, links: tuple[tuple[str, str], ...], inverters: tuple[str, ...], problems: Problems) -> None:
    seen: set[frozenset[str]] = set()
    for i, pair in enumerate(links):
        for name in pair:
            problems.unknown(f"{path}[{i}]", "inverter", name, inverters)
        if pair[0] == pair[1]:
            problems.add(f"{path}[{i}]", f'a link joins two inverters, got "{pair[0]}" twice')
        elif frozenset(pair) in seen:
            problems.add(f"{path}[{i}]", f"{pair[0]} - {pair[1]} is listed already; links have no direction")
        seen.add(frozenset(pair))


PART_OF_T = {"first-order": 0.3, "second-order": 1.0}
"""Longest integration step of a method, as a part of the inverters' shortest time constant: at 0.4 of it the first
rings on microgrid123; the second is stable up to 2 of it."""


def check_times(scenario: ScenarioModel, problems: Problems) -> None:
    time = scenario.time
    paths = [f"event[{i}].t_s" for i in range(len(scenario.events))]
    read = {path for path in paths if not problems.touch(path)}  # a time off its grid is a time nevertheless
    for i, event in enumerate(scenario.events):
        path = f"event[{i}].t_s"
        multiple(path, event.t_s, "time.h_s", time.h_s, "the step of the plant", problems)
        if path in read and event.t_s >= time.end_s > 0:  # a missing end is 0
            problems.add(
                path,
                f'event "{event.label}" at {event.t_s:g} s is not before the end at {time.end_s:g} s; '
                "move it, or raise end_s",
            )
    for i, (first, second) in enumerate(pairwise(scenario.events)):
        path, gap = f"event[{i + 1}].t_s", second.t_s - first.t_s
        if not {f"event[{i}].t_s", path} <= read:
            continue
        if gap <= 0:
            problems.add(
                path,
                f'event "{second.label}" at {second.t_s:g} s is written after "{first.label}" at {first.t_s:g} s; '
                "write events in the order of time, and changes at one time as one event",
            )
        elif not problems.touch("time.record_s") and gap < 1.5 * time.record_s:
            problems.add(
                path,
                f'event "{second.label}" follows "{first.label}" after {gap:g} s, with no recorded row between them to '
                f"measure; write them as one event, or lower record_s = {time.record_s:g} s",
            )


def check_step(scenario: ScenarioModel, feeder: Tables | None, problems: Problems) -> None:
    gfm, gfl = scenario.plant.gfm, scenario.plant.gfl
    of = {
        (table, name): T
        for table, model in (("plant.gfm", gfm), ("plant.gfl", gfl))
        for name, T in model.time_constants().items()
    }
    if feeder:
        for row in (*feeder.inverters, *feeder.spares):
            if row.parameters or row.own:
                own = feeder.parameters_of(row, gfm, gfl).time_constants()
                of |= {(f"plant.inverter.{row.name}", name): T for name, T in own.items()}
    (table, name), least = min(of.items(), key=lambda item: item[1], default=(("", ""), math.inf))
    part, h = PART_OF_T[scenario.time.method], scenario.time.h_s
    most = part * least
    if problems.touch("time.h_s", f"{table}.{name}_s") or h <= most * (1.0 + 1e-9):
        return
    problems.add(
        "time.h_s",
        f"{h:g} s is too long a step to resolve {name}_s = {least:g} s of [{table}]; "
        f"at most {most:g} s, {part:g} of the shortest time constant",
    )
