"""The HELICS federate of a run, for its plant: topics, requests with a deadline, failures in one sentence.

A plant publishes its sensors of each record time t. A controller publishes set-points `ACT` later, when all values of
t are there. The plant takes these set-points for the step after t (docs/how-to/cosimulation.md).
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from time import monotonic
from typing import Any, Literal, NamedTuple

from gridpeers.bridges.helics.helics_simulator import HelicsSettings, endpoint
from gridpeers.plant.request_process import ProcessEndedError, RequestProcess
from gridpeers.wire.driver.command_line import pip_install
from gridpeers.wire.wording import damaged

ACT = 1e-6
"""Time (s) between the plant's values and the set-points: shorter than any step of a plant, and a thousand times the
resolution of HELICS."""

Value = float | bool | str  # value of a topic


class Topic(NamedTuple):
    """One HELICS value."""

    key: str
    type: Literal["double", "boolean", "string"]
    unit: str  # unit in HELICS, which converts from that of the publisher; "" for none


SENSORS = (  # measurements of every inverter, in the order of a recorded row
    Topic("f", "double", "Hz"),
    Topic("P", "double", "W"),
    Topic("Q", "double", "var"),
    Topic("V", "double", "V"),
)

HELD = (Topic("P_set_held", "double", "W"), Topic("V_set_held", "double", "V"))
"""Set-points that an inverter follows after its limits, in the order of a recorded row, after the sensors."""

WHERE = (Topic("grid_connected", "boolean", ""), Topic("island", "string", ""))
"""An inverter's island: whether the substation feeds it, and its name."""

SET_POINTS = (Topic("P_set", "double", "W"), Topic("V_set", "double", "V"))
"""Set-points that a controller publishes for every inverter."""


def topics(prefix: str, inverters: Iterable[str], *groups: Iterable[Topic]) -> list[Topic]:
    """Return the topics of some groups for each of some inverters, as `grid/inv1/P_set`."""
    return [
        topic._replace(key=f"{prefix}/{inverter}/{topic.key}")
        for inverter in inverters
        for group in groups
        for topic in group
    ]


def events(prefix: str) -> Topic:
    """Return the topic of a plant's events: a JSON list with t, kind, subject, text of each."""
    return Topic(f"{prefix}/events", "string", "")


def number(value: Value) -> float:
    """Return a value as a number; not-a-number for -1e49, HELICS's mark of a missing double."""
    return float(value) if abs(float(value)) < 1e40 else math.nan


USER = "a HELICS federate"
IMPORT = 60.0  # longest time (s) for the import of HELICS on a busy machine
FAREWELL = 3.0  # longest wait (s) for the process to leave the federation
BEFORE = "before t = 0"
LATER = 3.0  # time (s) for the answer of the process after its own wait for the broker


class HelicsError(RuntimeError):
    """The federation, or this federate, cannot continue."""


class HelicsFederate:
    """A federate in a process of its own (`federate_process.py`); `deadline` is its longest wait (s) for the others."""

    def __init__(self, settings: HelicsSettings, deadline: float) -> None:
        self._settings, self._deadline = settings, deadline
        self._when = BEFORE
        self._others = "nobody"  # names of the other federates
        self._process = RequestProcess([sys.executable, str(Path(__file__).with_name("federate_process.py"))])
        ready = self._take(IMPORT, f"its process did not start within {IMPORT:g} s")
        if "not_importable" in ready:
            self._process.close(FAREWELL)
            missing = f"{USER} needs the package helics; install it: {pip_install('helics')}"
            raise HelicsError(damaged("helics", ready["not_importable"], USER) if ready["installed"] else missing)
        host, port = endpoint(settings.broker)
        request = {"do": "join", "name": settings.name, "host": host, "port": port}
        late = f"{settings.broker} did not answer as a HELICS broker of core type ZMQ within {deadline:g} s"
        self._ask(request | {"wait": 0.9 * deadline}, late, deadline + LATER)

    def begin(self, publications: Sequence[Topic], subscriptions: Sequence[Topic]) -> dict[str, list[str]]:
        """Register topics, and wait until all federates are at t = 0.

        Return the names of the other federates (`others`), and the subscriptions without a publisher (`missing`).
        """
        settings = self._settings
        late = f"the federation at {settings.broker} did not begin within {settings.wait:g} s (are all started?)"
        request = {"do": "begin", "publications": publications, "subscriptions": subscriptions}
        federation = self._ask(request, late, settings.wait)
        self._others = " or ".join(federation["others"]) or "the broker"
        return federation

    def step(self, publish: Mapping[str, Value], t: float) -> dict[str, Value]:
        """Publish, go to `ACT` after a time (s), and return the values since the last step, by key.

        Raise HelicsError if a publisher without a new value has left.
        """
        late = f"{self._others} did not let time go on to {t:g} s within {self._deadline:g} s"
        request = {"do": "step", "publish": publish, "time": t + ACT}
        answer = self._ask(request, late, self._deadline)
        if answer["gone"]:
            raise HelicsError(
                f"HELICS, {self._when}: {' and '.join(answer['gone'])} left the federation before the end; "
                "let it run at least as long as the scenario"
            )
        self._when = f"t = {t:g} s"
        values: dict[str, Value] = answer["values"]
        return values

    def end(self) -> None:
        """Leave the federation, which goes on without this federate."""
        try:
            self._ask({"do": "end"}, "the federate did not leave", self._deadline)
        except HelicsError:
            pass  # the run has ended already
        finally:
            self.abort("")

    def abort(self, reason: str) -> None:
        """End the process if it runs; the other federates get the reason."""
        if not self._process.closed:
            self._process.send({"do": "abort", "reason": f"{self._settings.name}: {reason}"})
            self._process.close(FAREWELL)

    def _ask(self, request: Mapping[str, Any], late: str, wait: float) -> dict[str, Any]:
        self._process.send(request)
        try:
            answer = self._take(wait, late)
            if "error" in answer:
                raise HelicsError(f"HELICS, {self._when}: {self._explained(answer['error'], request['do'])}")
        except HelicsError as error:
            self.abort(str(error))
            raise
        return answer

    def _take(self, wait: float, late: str) -> dict[str, Any]:
        try:
            answer = self._process.answer(monotonic() + wait)
        except ProcessEndedError as how:
            last = self._process.printed()[-300:].strip().rpartition("\n")[2]
            name = self._settings.name
            raise HelicsError(
                f"HELICS, {self._when}: our federate {name} {how}; {last or 'it printed nothing'}"
            ) from None
        if answer is None:
            key = "plant.helics.wait_s" if self._when == BEFORE else "processes.deadline_s"
            raise HelicsError(f"HELICS, {self._when}: {late}; end what hangs, or raise {key}")
        return answer

    def _explained(self, error: str, doing: str) -> str:
        broker = self._settings.broker
        if error.startswith("no broker"):
            return f"{error}; start one: helics_broker -f 2"
        if "lost connection with broker" in error:
            return f"the broker at {broker} has ended, or cannot be reached any more"
        if "lost comms" in error:
            return f"a federate at {broker} died without leaving ({error})"
        if "duplicate" in error.lower():
            return f'{error}; the name "{self._settings.name}" is taken at {broker}: choose another plant.helics.name'
        return error if doing == "join" else f"the federation ended: {error}"
