"""One HELICS federate: the only file that knows the package `helics`.

It is a process of its own, because HELICS prints from its own threads, and because Python cannot end a wait inside its
library. `gridpeers.bridges.helics.federate` starts it as a script, so it imports nothing of gridpeers. Each line of
standard input is a JSON object with a request, and each line of standard output is its answer. The output of HELICS
goes to standard error.

    {"do": "join", "name", "host", "port", "wait"}
    {"do": "begin", "publications": [[key, type, unit]], "subscriptions": [...]}
    {"do": "step", "publish": {key: value}, "time"}     publish, go to a time (s), return the new values
    {"do": "end"}                                       leave the federation, end
    {"do": "abort", "reason": text}                     end the federation at once, also during a wait
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import socket
import sys
import threading
import time
from typing import Any

GLOBAL_ERROR = 1  # HELICS's error code of a federation that we end
FAREWELL = 0.3  # time (s) in which an abort reaches the others
NOBODY = "any"  # type of a topic that nobody publishes
PROBE = 0.1  # time (s) between two attempts to reach a broker
GONE = ("disconnected", "finalized", "error")  # states of a federate that has left


class _RefusedError(Exception):
    """A request that cannot be carried out."""


class Federate:
    """The federate with its topics; each method but `abort` answers the request of its name."""

    def __init__(self) -> None:
        import helics

        self.helics: Any = helics
        self.fed: Any = None
        self.name = ""
        self.publications: dict[str, tuple[Any, str]] = {}
        self.subscriptions: dict[str, tuple[Any, str]] = {}
        self.publishers: dict[str, set[str]] = {}  # by federate: our subscriptions that it publishes

    def join(self, request: dict[str, Any]) -> dict[str, Any]:
        helics, host, port = self.helics, request["host"], request["port"]
        self.name = request["name"]
        _reach(host, port, request["wait"])
        info = helics.helicsCreateFederateInfo()
        helics.helicsFederateInfoSetCoreTypeFromString(info, "zmq")
        options = f"--federates=1 --loglevel=no_print --broker_address=tcp://{host}:{port}"
        if host == "127.0.0.1":
            options += f" --localinterface=tcp://{host}"
        helics.helicsFederateInfoSetCoreInitString(info, options)
        helics.helicsFederateInfoSetIntegerProperty(
            info, helics.HELICS_PROPERTY_INT_LOG_LEVEL, helics.HELICS_LOG_LEVEL_NO_PRINT
        )
        # a value between two requested times must not wake it: its times are those of the control period
        helics.helicsFederateInfoSetFlagOption(info, helics.HELICS_FLAG_UNINTERRUPTIBLE, True)
        self.fed = helics.helicsCreateValueFederate(self.name, info)
        return {}

    def begin(self, request: dict[str, Any]) -> dict[str, Any]:
        helics = self.helics
        for key, kind, unit in request["publications"]:
            code = getattr(helics, f"HELICS_DATA_TYPE_{kind.upper()}")
            self.publications[key] = helics.helicsFederateRegisterGlobalPublication(self.fed, key, code, unit), kind
        # HELICS itself would warn of each topic without a publisher; `missing` below names those that matter
        helics.helicsFederateSetFlagOption(self.fed, helics.HELICS_HANDLE_OPTION_CONNECTION_OPTIONAL, True)
        for key, kind, unit in request["subscriptions"]:
            self.subscriptions[key] = helics.helicsFederateRegisterSubscription(self.fed, key, unit), kind
        helics.helicsFederateEnterInitializingMode(self.fed)
        helics.helicsFederateEnterExecutingMode(self.fed)
        others = [name for name in self._names("root", "federates") if name != self.name]
        for name in others:
            if keys := self.subscriptions.keys() & set(self._names(name, "publications")):
                self.publishers[name] = set(keys)
        if not self.publishers:  # a federate that does not wait for our values may have left: its topics are not known
            self.publishers = {name: set(self.subscriptions) for name in others}
        type_of = helics.helicsInputGetPublicationType
        missing = [key for key, (topic, _) in self.subscriptions.items() if type_of(topic) == NOBODY]
        return {"others": others, "missing": missing}

    def step(self, request: dict[str, Any]) -> dict[str, Any]:
        helics = self.helics
        self._publish(request["publish"])
        helics.helicsFederateRequestTime(self.fed, request["time"])
        read = {
            "double": helics.helicsInputGetDouble,
            "boolean": lambda topic: bool(helics.helicsInputGetBoolean(topic)),
            "string": helics.helicsInputGetString,
        }
        values = {
            key: read[kind](topic)
            for key, (topic, kind) in self.subscriptions.items()
            if helics.helicsInputIsUpdated(topic)
        }
        silent = [name for name, keys in self.publishers.items() if not keys & values.keys()]
        gone = [name for name in silent if self._query(name, "state") in GONE]
        return {"values": values, "gone": gone}

    def end(self, _request: dict[str, Any]) -> dict[str, Any]:
        self.helics.helicsFederateDisconnect(self.fed)
        return {}

    def abort(self, reason: str) -> None:
        """End the federation for everybody, with a reason that others can print."""
        if self.fed is None:
            return
        with contextlib.suppress(Exception):
            self.helics.helicsFederateGlobalError(self.fed, GLOBAL_ERROR, reason)
            time.sleep(FAREWELL)  # HELICS does not show that the others have received it

    def _publish(self, values: dict[str, Any]) -> None:
        helics = self.helics
        write = {
            "double": helics.helicsPublicationPublishDouble,
            "boolean": lambda topic, value: helics.helicsPublicationPublishBoolean(topic, int(value)),
            "string": helics.helicsPublicationPublishString,
        }
        for key, value in values.items():
            topic, kind = self.publications[key]
            write[kind](topic, value)

    def _names(self, target: str, what: str) -> list[str]:
        """Return the names in the answer to a query; none without an answer, as for a federate that has left."""
        answer = self._query(target, what)
        return answer if isinstance(answer, list) else []

    def _query(self, target: str, what: str) -> Any:
        query = self.helics.helicsCreateQuery(target, what)
        try:
            return self.helics.helicsQueryExecute(query, self.fed)
        finally:
            self.helics.helicsQueryFree(query)


def _reach(host: str, port: int, wait: float) -> None:
    """Wait until a process listens there; HELICS itself reports a missing broker much later."""
    until = time.monotonic() + wait
    while True:
        try:
            with socket.create_connection((host, port), timeout=max(PROBE, until - time.monotonic())):
                return
        except OSError as error:
            if time.monotonic() + PROBE > until:
                why = error.strerror or str(error)
                raise _RefusedError(f"no broker at tcp://{host}:{port} within {wait:g} s ({why})") from None
            time.sleep(PROBE)


def main() -> None:
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    requests: queue.Queue[dict[str, Any]] = queue.Queue()

    def answer(content: dict[str, Any]) -> None:
        with contextlib.suppress(OSError):  # the parent is gone: so is this process, in a moment
            answers.write(json.dumps(content) + "\n")

    try:
        federate = Federate()
    except Exception as error:  # a damaged package may raise anything
        missing = isinstance(error, ModuleNotFoundError) and error.name == "helics"
        answer({"not_importable": f"{type(error).__name__}: {error}", "installed": not missing})
        return
    answer({"ready": True})

    def listen() -> None:
        """Queue requests, and carry out an abort at once."""
        for line in sys.stdin:
            request = json.loads(line)
            if request["do"] == "abort":
                federate.abort(request["reason"])
                os._exit(0)
            else:
                requests.put(request)
        federate.abort(f"{federate.name}: its gridpeers process was killed")
        os._exit(0)

    threading.Thread(target=listen, daemon=True).start()
    while True:
        request = requests.get()
        try:
            answer(getattr(federate, request["do"])(request))
        except Exception as error:
            text = str(error)  # of HELICS with a number before it
            answer({"error": text.partition("] ")[2] if text.startswith("[") else text})
        if request["do"] == "end":
            answers.close()
            os._exit(0)


if __name__ == "__main__":
    main()
