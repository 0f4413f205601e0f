"""Follow one value through a real run, and count its way: ``python -m tests.way.way [--write]``.

The run is the paper's islanding, case IV, on the in-process bus, with its codec, nodes and plant, and an emulated fault
on every link between agents. The value is the measurement of one agent at one tick without change of roster, and the
state that answers it. On its way are, each once a leg, the functions of this repository that take, return or enclose
it, and all that these call until it is handed on; a law is one call, its `step`. Off it is what sees other agents'
values alone, what happens once a tick for all (`advance`), and the driver that carries bytes (here a bus, between
processes `wire/driver`). A comprehension belongs to its function; compiled code, the standard library and packages do
not count.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from types import FrameType
from typing import Any

from msgspec.structs import replace

from gridpeers.agents.laws.law import Neighbour, Own
from gridpeers.netem.schema.fault import Fault
from gridpeers.plant.build import start_plant
from gridpeers.plant.feeder.plant import Plant
from gridpeers.plant.plant_interface import Reading
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.configs import configs
from gridpeers.wire.codec import decode, encode
from gridpeers.wire.messages import Measurement, State

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "architecture.md"
BEGIN, END = "<!-- begin: python -m tests.way.way --write -->\n", "<!-- end -->\n"

TICK = 55  # In the islanded microgrid, at t = 1.1 s

FAULTS = (Fault(on="* -> *", loss=1e-6),)
"""Between agents alone: a fault of a link of the plant has the same steps as that of the leg to the neighbour."""

LEGS = {
    "measurement": "sensed, sent, received; the law; the state sent",
    "to the neighbour": "the state received, judged by the emulated link, kept",
    "to the plant": "the state received, judged, held within the limits of the inverter",
}


@dataclass
class Call:
    """A call of ours: its function, its arguments, its result (of a generator one value), and the calls within."""

    file: str
    name: str
    arguments: tuple[Any, ...]
    number: int = 0
    calls: list[Call] = field(default_factory=list)
    result: Any = None


def _file_of(frame: FrameType) -> str:
    """Return the path of a frame's code in the repository, "" if it is not ours or a comprehension's."""
    code, root = frame.f_code, f"{ROOT}/"
    path = code.co_filename.removeprefix(root)
    strange = (
        path == code.co_filename or path.startswith((".venv/", "tests/")) or code.co_name.endswith(("comp>", "expr>"))
    )
    return "" if strange else path.removeprefix("gridpeers/")


def run() -> tuple[list[Call], int, str, str]:
    """Run; return the driver's calls of three ticks, the first after the plant has held, the first and last agent."""
    scenario, feeder = load_scenario("islanding")
    netem = replace(scenario.netem, links=FAULTS)
    plant_config, agents = configs(
        replace(scenario, netem=netem, events=scenario.events[:1]), feeder, "IV", "tcp/127.0.0.1:0"
    )
    plant_config = replace(plant_config, end=1.2)
    plant = start_plant(plant_config)
    assert isinstance(plant, Plant)
    driver = Call("", "", ())
    stack, numbers, held = [driver], count(1), []
    advance = plant.advance

    def profile(frame: FrameType, event: str, result: Any) -> None:
        if event not in ("call", "return") or not (file := _file_of(frame)) or file.startswith("scenarios/drivers/"):
            return
        if event == "return":
            if len(stack) > 1:
                stack.pop().result = result
            return
        code = frame.f_code
        names = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
        arguments = tuple(frame.f_locals[name] for name in names if name in frame.f_locals)
        stack[-1].calls.append(Call(file, code.co_qualname.replace(".<locals>", ""), arguments, next(numbers)))
        stack.append(stack[-1].calls[-1])

    def traced() -> None:
        sys.setprofile(None)
        if plant.tick == TICK:
            held.append(next(numbers))
        advance()
        if TICK - 1 <= plant.tick < TICK + 2:
            sys.setprofile(profile)

    plant.advance = traced  # type: ignore[method-assign]
    run_inprocess(plant_config, agents, lambda telemetry: None, plant=plant, messages=True)
    return driver.calls, held[0], plant_config.agents[0], plant_config.agents[-1]


class Value:
    """The value that is followed, in each of its forms."""

    def __init__(self, measurement: Measurement, state: State) -> None:
        self.messages = measurement, state
        self._sent = encode(state)
        self._bytes = {encode(measurement), self._sent}
        self._numbers = {state.P_set, state.V_set}
        self._reading = measurement.P, measurement.Q, measurement.V, measurement.f

    def _in(self, thing: object, test: Callable[[object], bool], depth: int = 3) -> bool:
        """Return whether a thing, or one in its collections, passes a test."""
        if isinstance(thing, dict):
            thing = tuple(thing.values())
        if isinstance(thing, list | tuple) and not isinstance(thing, Reading | Own | Neighbour):
            return depth > 0 and any(self._in(each, test, depth - 1) for each in thing)
        return test(thing)

    def _is(self, thing: object) -> bool:
        if isinstance(thing, Reading):
            return (thing.P, thing.Q, thing.V, thing.f) == self._reading
        if isinstance(thing, Measurement | State):
            return thing in self.messages
        if isinstance(thing, Own):  # the measurement, per unit
            return True
        return (isinstance(thing, bytes) and thing in self._bytes) or (
            isinstance(thing, float) and thing in self._numbers
        )

    def passes(self, call: Call) -> bool:
        """Return whether a function gets or returns the value."""
        return self._in((call.arguments, call.result), self._is)

    def sends(self, call: Call) -> bool:
        """Return whether a function gets or returns the state."""
        return self._in((call.arguments, call.result), lambda thing: thing == self.messages[1] or thing == self._sent)

    def _is_of_others(self, call: Call) -> bool:
        return not self.passes(call) and self._in(
            (call.arguments, call.result), lambda x: isinstance(x, Measurement | State | Neighbour)
        )

    def part(self, call: Call, *, passes: bool = False) -> list[Call]:
        """Return, of a call and the calls within, those on the value's way, in order."""
        passes = (passes and not self._is_of_others(call)) or self.passes(call)
        within = () if call.name.endswith(".step") else call.calls
        inner = [each for it in within for each in self.part(it, passes=passes)]
        return [call, *inner] if passes or inner else []


def _post(call: Call) -> object:
    """Return the post of the node that a driver's call is of."""
    return getattr(call.arguments[0], "post", call.arguments[0])


def way() -> dict[str, list[tuple[str, str]]]:
    """Return, by leg, the file and the name of each function on the way, in the order in which it is entered first."""
    calls, held, near, far = run()
    received = [(call, decode(call.arguments[2])) for call in calls if call.name.endswith(".received")]
    of_tick = [(call, message) for call, message in received if message.seq == TICK]
    [(at_agent, measurement)] = [(call, m) for call, m in of_tick if isinstance(m, Measurement) and m.to == far]
    sent = [(call, message) for call, message in of_tick if isinstance(message, State) and message.sender == far]
    [neighbour] = [_post(c) for c, m in of_tick if isinstance(m, Measurement) and m.to == near]
    agents = {id(_post(call)) for call, message in of_tick if isinstance(message, Measurement)}
    [at_neighbour] = [call for call, _ in sent if _post(call) is neighbour]
    [at_plant] = [call for call, _ in sent if id(_post(call)) not in agents]
    value = Value(measurement, sent[0][1])

    def of(post: object, calls: list[Call]) -> list[Call]:
        return [each for call in calls if _post(call) is post for each in value.part(call)]

    agent, plant, start = _post(at_agent), _post(at_plant), calls.index(at_agent)
    decided = value.part(at_agent)
    decided = decided[: 1 + max(i for i, call in enumerate(decided) if value.sends(call))]
    handed_on = next(call for call in calls[start + 1 :] if _post(call) is agent)
    legs = (
        [*of(plant, calls[:start]), *decided, *value.part(handed_on)],
        of(neighbour, calls[calls.index(at_neighbour) :]),
        [call for call in of(plant, calls[calls.index(at_plant) :]) if call.number < held],
    )
    return {
        leg: list(dict.fromkeys((call.file, call.name) for call in found))
        for leg, found in zip(LEGS, legs, strict=True)
    }


def files_of(leg: Sequence[tuple[str, str]]) -> dict[str, list[str]]:
    return {file: [name for other, name in leg if other == file] for file in dict.fromkeys(file for file, _ in leg)}


def table(legs: Mapping[str, Sequence[tuple[str, str]]]) -> str:
    """Return the way as a table in Markdown: by leg all files, and their functions in the order of the first calls."""
    rows = ["| leg | file | calls |", "|---|---|---|"]
    for leg, found in legs.items():
        files = files_of(found)
        rows.append(f"| **{leg}**: {LEGS[leg]} | {len(files)} files | {len(found)} calls |")
        rows += [f"| | `{file}` | {', '.join(f'`{name}`' for name in names)} |" for file, names in files.items()]
    every = {each for found in legs.values() for each in found}
    rows.append(f"| all three | {len(files_of(sorted(every)))} files | {len(every)} functions |")
    return "\n".join(rows) + "\n"


def page_with(table: str) -> str:
    before, rest = PAGE.read_text().split(BEGIN)
    return before + BEGIN + table + END + rest.split(END)[1]


if __name__ == "__main__":
    made = table(way())
    print(made)
    if "--write" in sys.argv:
        PAGE.write_text(page_with(made))
