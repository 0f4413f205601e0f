"""What the keys of a scenario ask of each other and of the feeder."""

from __future__ import annotations

import re
from itertools import pairwise

from plant.equipment import Feeder
from scenarios.spec.multiples import divides, multiple
from scenarios.spec.scenario_errors import Mistakes
from scenarios.spec.scenario_model import Scenario
from wire.plugin import plugin_of
from wire.suggestion import suggestion

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,30}")
"""Names become folders and, two of them joined, a part of every key, which `wire.keys` bounds at 64 letters."""

PART_OF_T = 0.3
"""Longest integration step, as a part of the inverters' shortest time constant: at 0.4 microgrid123 oscillates."""

_RUN_FOLDER = ("log", "plots", "metrics.json", "report.txt", "scenario.toml", "status.txt")
"""What a run folder holds beside the folders of the cases."""


def check_times(scenario: Scenario, mistakes: Mistakes) -> None:
    """Every time of the scenario falls on the grid it belongs to, and events come in the order of time."""
    time = scenario.time
    paths = ["time.end_s", "time.record_s", *(f"event[{i}].t_s" for i in range(len(scenario.events)))]
    read = {path for path in paths if not mistakes.touch(path)}  # a time off its grid is a time nevertheless
    divides("time.h_s", time.h_s, "time.T_c_s", time.T_c_s, mistakes)
    multiple("time.record_s", time.record_s, "time.h_s", time.h_s, "", mistakes)
    divides("time.record_s", time.record_s, "time.T_c_s", time.T_c_s, mistakes)
    multiple("time.end_s", time.end_s, "time.T_c_s", time.T_c_s, "", mistakes)
    for i, event in enumerate(scenario.events):
        path = f"event[{i}].t_s"
        multiple(path, event.t_s, "time.h_s", time.h_s, "the step of the plant", mistakes)
        if {path, "time.end_s"} <= read and event.t_s >= time.end_s:
            mistakes.add(
                path,
                f'event "{event.label}" at {event.t_s:g} s does not come before the end at {time.end_s:g} s; '
                "move it, or raise end_s",
            )
    for i, (first, second) in enumerate(pairwise(scenario.events)):
        path, gap = f"event[{i + 1}].t_s", second.t_s - first.t_s
        if not {f"event[{i}].t_s", path} <= read:
            continue
        if gap <= 0:
            mistakes.add(
                path,
                f'event "{second.label}" at {second.t_s:g} s is written after "{first.label}" at {first.t_s:g} s; '
                "write events in the order of time, and what happens at once as one event",
            )
        elif "time.record_s" in read and gap < 1.5 * time.record_s:
            mistakes.add(
                path,
                f'event "{second.label}" follows "{first.label}" by {gap:g} s, so that no recorded row lies between '
                f"them to measure; write them as one event, or lower record_s = {time.record_s:g} s",
            )


def check_step(scenario: Scenario, mistakes: Mistakes) -> None:
    """The integration step resolves every time constant of the inverters; if not, the numbers ring or run away."""
    gfm, gfl = scenario.plant.gfm, scenario.plant.gfl
    of = {("plant.gfm", name): getattr(gfm, name) for name in ("T_p", "T_q", "T_v")}
    of |= {("plant.gfl", name): getattr(gfl, name) for name in ("T_ff", "T_pf", "T_vf", "T_qf")}
    if gfl.model == "current_source":
        of["plant.gfl", "T_if"] = gfl.T_if
    (table, name), least = min(of.items(), key=lambda item: item[1])
    most, h = PART_OF_T * least, scenario.time.h_s
    if mistakes.touch("time.h_s", f"{table}.{name}_s") or h <= most * (1.0 + 1e-9):
        return
    mistakes.add(
        "time.h_s",
        f"{h:g} s is too long a step for {name}_s = {least:g} s of [{table}]: what it computes would ring; "
        f"at most {most:g} s, {PART_OF_T:g} of the shortest time constant",
    )


def check_names(scenario: Scenario, mistakes: Mistakes) -> None:
    """Names can become folders, labels are unique, limits are in order."""
    for path, name in [
        ("name", scenario.name),
        *((f"case.{case}", case) for case in scenario.cases),
        *((f"event[{i}].label", event.label) for i, event in enumerate(scenario.events)),
    ]:
        if not mistakes.touch(path) and not _NAME.fullmatch(name):
            mistakes.add(path, f'name "{name}" must be up to 31 letters, digits, "_", "-" or ".", as it names files')
    labels = [event.label for event in scenario.events]
    for i, label in enumerate(labels):
        if label in labels[:i]:
            mistakes.add(
                f"event[{i}].label", f'there is an event "{label}" already; labels name windows of measurement'
            )
        elif label == "history_sha256":
            mistakes.add(f"event[{i}].label", "this name is taken by a key of metrics.json; choose another")
    if not scenario.cases and not mistakes.touch("case"):
        mistakes.add("case", "there is no case; write at least one table [case.NAME]")
    own = {f"case.{name}.gains": case.gains for name, case in scenario.cases.items() if case.gains != scenario.gains}
    for path, limits in ({"gains": scenario.gains} | own).items():
        _ordered(path, "P_set_min_pu", limits.P_set_min, "P_set_max_pu", limits.P_set_max, mistakes)
        _ordered(path, "V_set_min_pu", limits.V_set_min, "V_set_max_pu", limits.V_set_max, mistakes)
        if limits.V_full > 0.0:
            _ordered(path, "alpha_min", limits.alpha_min, "alpha", limits.alpha, mistakes)
    gfm, gfl = scenario.plant.gfm, scenario.plant.gfl
    _ordered("plant.gfm", "P_min_pu", gfm.P_min, "P_max_pu", gfm.P_max, mistakes)
    _ordered("plant.gfm", "Q_min_pu", gfm.Q_min, "Q_max_pu", gfm.Q_max, mistakes)
    _ordered("plant.gfm", "E_min_pu", gfm.E_min, "E_max_pu", gfm.E_max, mistakes)
    _ordered("plant.gfl", "P_min_pu", gfl.P_min, "P_max_pu", gfl.P_max, mistakes)
    _ordered("plant.gfm", "V_set_min_pu", gfm.V_set_min, "V_set_max_pu", gfm.V_set_max, mistakes)
    _ordered("plant.gfl", "V_set_min_pu", gfl.V_set_min, "V_set_max_pu", gfl.V_set_max, mistakes)


def check_start(scenario: Scenario, feeder: Feeder, mistakes: Mistakes) -> None:
    """Every inverter can give its first set-point, else the start is no equilibrium and moves without an event."""
    plant = scenario.plant
    gfm, gfl, start = plant.gfm, plant.gfl, plant.P_set0_pu
    limits = {
        "GFM": [("gfm.P_max_pu", gfm.P_max), ("gfm.P_set_lim_pu", gfm.P_set_lim), ("gfm.P_min_pu", gfm.P_min)],
        "GFL": [
            ("gfl.P_max_pu", gfl.P_max),
            ("gfl.S_max_pu", gfl.S_max),
            ("gfl.i_max_pu", gfl.i_max),
            ("gfl.P_set_lim_pu", gfl.P_set_lim),
            ("gfl.P_min_pu", gfl.P_min),
        ],
    }
    if mistakes.touch("plant.P_set0_pu", "plant.gfm", "plant.gfl"):
        return
    for kind, keys in limits.items():
        units = [row for row in feeder.inverters if row.kind == kind]
        for key, limit in keys:
            below = key.endswith("P_min_pu")
            if not units or mistakes.touch(f"plant.{key}") or (start >= limit if below else start <= limit):
                continue
            kW = ", ".join(
                f"{row.name} {start * row.P_rated / 1e3:g} of {limit * row.P_rated / 1e3:g}" for row in units
            )
            mistakes.add(
                "plant.P_set0_pu",
                f"{start:g} pu is {'below' if below else 'above'} plant.{key} = {limit:g} pu, so the start is no "
                f"equilibrium ({kW} kW); {'raise' if below else 'lower'} P_set0_pu, or change {key}",
            )
            break
    for table, (low, high) in (
        ("gfm", (gfm.V_set_min, gfm.V_set_max)),
        ("gfl", (gfl.V_set_min, gfl.V_set_max)),
    ):
        V = plant.V_set0_pu
        if mistakes.touch("plant.V_set0_pu") or low <= V <= high:
            continue
        mistakes.add(
            "plant.V_set0_pu",
            f"{V:g} pu is beyond plant.{table}.V_set_min_pu = {low:g} to V_set_max_pu = "
            f"{high:g}, which limit every later set-point; choose it within, or change them",
        )


def check_cases(scenario: Scenario, inverters: tuple[str, ...], mistakes: Mistakes) -> None:
    """Listed links join two known inverters, and are listed where the graph is "links"."""
    for name, case in scenario.cases.items():
        if name in _RUN_FOLDER:
            mistakes.add(f"case.{name}", f"a case's folder stands beside {', '.join(_RUN_FOLDER)}; name it otherwise")
        if inverters:
            _check_links(f"case.{name}.without", case.without, inverters, mistakes)
        path = f"case.{name}.links"
        if mistakes.touch(path, f"case.{name}.graph"):
            continue
        graph = plugin_of(case.graph).use
        if graph == "links" and not case.links:
            mistakes.add(f"case.{name}.graph", 'graph "links" needs the key links, e.g. links = [["inv1", "inv4"]]')
        if graph != "links" and case.links:
            mistakes.add(path, f'links are listed, but the graph is "{graph}"; write graph = "links"')
        if inverters:
            _check_links(path, case.links, inverters, mistakes)


def check_events(scenario: Scenario, mistakes: Mistakes) -> None:
    """Every event does something, and the cases name events that there are."""
    for i, event in enumerate(scenario.events):
        keys = ("open", "close", "leave", "join", "P_max_kW")
        if not any(getattr(event, key) for key in keys) and not mistakes.touch(*(f"event[{i}].{key}" for key in keys)):
            mistakes.add(
                f"event[{i}]",
                f'event "{event.label}" does nothing; give it {", ".join(keys)}, e.g. open = ["13-152"]',
            )
        if event.synchronised and not event.close and not mistakes.touch(f"event[{i}].close"):
            mistakes.add(
                f"event[{i}].synchronised",
                f'event "{event.label}" closes no switch that could wait for synchronism; give it close',
            )
    labels = [event.label for event in scenario.events]
    for name, case in scenario.cases.items():
        for label in case.P_max_kW:
            if label not in labels:
                mistakes.add(f"case.{name}.P_max_kW", f'no event "{label}"; {suggestion(label, labels, "events")}')


def check_switches(scenario: Scenario, feeder: Feeder, mistakes: Mistakes) -> None:
    """Switches exist and are in the other position when an event operates them."""
    position = {switch.name: switch.closed for switch in feeder.switches}
    canonical = {name: switch.name for switch in feeder.switches for name in switch.names}
    buses = {bus.name for bus in feeder.buses}
    for i, event in enumerate(scenario.events):
        named: set[str] = set()
        for action, closed, names in (("open", False, event.open), ("close", True, event.close)):
            for name in names:
                path = f"event[{i}].{action}"
                if name not in canonical:
                    mistakes.add(path, _unknown_switch(name, [s.alias or s.name for s in feeder.switches], buses))
                    continue
                switch = canonical[name]
                if switch in named:
                    mistakes.add(path, f'switch "{name}" is named twice in event "{event.label}"; name it once')
                elif position[switch] == closed:
                    mistakes.add(
                        path,
                        f'switch "{name}" is {"closed" if closed else "open"} already at {event.t_s:g} s; '
                        f"leave it out, or {'open' if closed else 'close'} it before",
                    )
                named.add(switch)
                position[switch] = closed


def _ordered(path: str, low_key: str, low: float, high_key: str, high: float, mistakes: Mistakes) -> None:
    if not mistakes.touch(f"{path}.{low_key}", f"{path}.{high_key}") and low >= high:
        mistakes.add(f"{path}.{low_key}", f"{low:g} must be below {high_key} = {high:g}; swap them or set both")


def _check_links(path: str, links: tuple[tuple[str, str], ...], inverters: tuple[str, ...], mistakes: Mistakes) -> None:
    seen: set[frozenset[str]] = set()
    for i, pair in enumerate(links):
        for name in pair:
            if name not in inverters:
                mistakes.add(f"{path}[{i}]", f'no inverter "{name}"; {suggestion(name, inverters, "inverters")}')
        if pair[0] == pair[1]:
            mistakes.add(f"{path}[{i}]", f'a link joins two inverters, got "{pair[0]}" twice')
        elif frozenset(pair) in seen:
            mistakes.add(f"{path}[{i}]", f"{pair[0]} - {pair[1]} is listed already; links have no direction")
        seen.add(frozenset(pair))


def _unknown_switch(name: str, known: list[str], buses: set[str]) -> str:
    """Say whether it is the switch or a bus that does not exist."""
    ends = name.split("-")
    strange = [end for end in ends if end[:1].isdigit() and end not in buses]
    why = f" (there is no bus {' and no bus '.join(strange)})" if strange else ""
    return f'no switch "{name}"{why}; {suggestion(name, known, "switches")}'
