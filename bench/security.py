"""What mutual TLS with access rules costs: a tick in lock-step, and the one-way time of a message at the rate of ticks.

Both are measured beside open links, round by round, so that a ratio holds whatever else the machine does. Lock-step:
the paper's islanding, case IV, a process for each of nine agents; the time from the first row to the last. One way:
two processes as agents are, one message of the size of a State every 20 ms, from its handover to Zenoh to the receiving
thread; with TLS alone too, to tell what of the difference the rules make.

    .venv/bin/python -m bench.security [--rounds 5] [--end 4.0] [--messages 250]
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from struct import pack, unpack_from
from time import monotonic
from typing import Annotated, Any

import msgspec
import pandas as pd
import typer
from msgspec.structs import replace

from bench.harness import machine, markdown, say
from gridpeers.scenarios.drivers.children import Child, Children
from gridpeers.scenarios.drivers.free_endpoint import free_endpoint
from gridpeers.scenarios.drivers.process_driver import run_processes
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.configs import configs, secured
from gridpeers.wire.driver.session import Session
from gridpeers.wire.keys import Keys
from gridpeers.wire.trust.credentials import Credentials
from gridpeers.wire.trust.key_folder import open_credentials
from gridpeers.wire.trust.site_authority import issue, make_site

SIZE, STAMP = 119, 8
"""Bytes of a State, and of a time (s) in it."""

TICK = 0.02
"""Time (s) between two messages: the control period."""

NEVER = 1 << 30
"""More messages than ever come: a process that waits for so many waits for the time."""

LONGEST = 60.0
"""Longest wait for a message (s)."""

WARM_UP = 25
"""Messages that are not counted: links and publishers are new."""


class Role(msgspec.Struct, frozen=True):
    """The configuration of one of the two processes."""

    role: str
    """receive or send."""
    key: str
    """The key of the messages."""
    count: int
    """Number of messages."""
    listen: tuple[str, ...]
    connect: tuple[str, ...]
    """Endpoints."""
    credentials: Credentials | None = None
    """Certificate of the process; None: links are open."""
    rules: bool = True
    """True if the session has access rules beside its certificate."""


class TlsAlone(Credentials, frozen=True):
    """A certificate without access rules: what of their cost is TLS's."""

    def zenoh_settings(self, *, star: bool) -> tuple[dict[str, Any], dict[str, Any]]:
        """Return Zenoh's settings ``transport/link``, and no ``access_control``."""
        return super().zenoh_settings(star=star)[0], {}


def lock_step(folder: Path, end: float, keys: Path | None) -> float:
    """Return the time (s) of a run, from its first row to its last."""
    scenario, feeder = load_scenario("islanding")
    protocol = "tcp" if keys is None else "tls"
    plant, agents = configs(scenario, feeder, "IV", f"{protocol}/127.0.0.1:0")
    plant = replace(plant, end=end)
    if keys is not None:
        names = tuple(row.name for row in feeder.inverters)
        plant, agents, _ = secured(plant, agents, keys, started=names, inverters=names)
    outcome = run_processes(plant, agents, folder, lambda telemetry: None)
    if outcome.broke:
        raise RuntimeError(outcome.broke)
    return outcome.run_s


def one_way(count: int, keys: Path | None, *, rules: bool = True) -> list[float]:
    """Return the one-way times (s) of so many messages from inv1 to inv2, over TLS if there are keys."""
    protocol = "tcp" if keys is None else "tls"
    shown: dict[str, Credentials | None] = dict.fromkeys(("inv1", "inv2"))
    if keys is not None:
        shown = {name: open_credentials(keys, ("agent",), name)[0] for name in shown}
    key, there = Keys("bench").state("inv1"), (free_endpoint(f"{protocol}/127.0.0.1:0"),)
    receiving = Role("receive", key, count, there, (), shown["inv2"], rules)
    sending = Role("send", key, count, (f"{protocol}/127.0.0.1:0",), there, shown["inv1"], rules)
    children, words = Children(), list[str]()
    with tempfile.TemporaryDirectory() as folder:
        try:
            for role, on_word in ((sending, None), (receiving, words.append)):
                log = Path(folder) / f"{role.role}.log"
                children.add(Child(role.role, [__file__, "role"], role, log, lambda child: None, on_word))
            receiver = children["receive"]
            if not receiver.join(monotonic() + LONGEST) or receiver.status != 0:
                raise TimeoutError(receiver.report(f"within {LONGEST:g} s"))
        finally:
            children.end()
    return msgspec.json.decode(words[-1], type=list[float])


def be(config: Role) -> None:
    """Be one of the two processes; the receiver prints the times (s), and the sender sends until it is ended."""
    credentials = config.credentials
    if credentials is not None and not config.rules:
        credentials = TlsAlone(**msgspec.structs.asdict(credentials))
    session = Session(
        config.role, listen=config.listen, connect=config.connect, clock="realtime", credentials=credentials
    )
    if config.role == "send":
        due, padding = monotonic(), bytes(SIZE - STAMP)
        for _ in range(round(LONGEST / TICK)):  # not for ever, if nobody ends it
            session.publish(config.key, pack("<d", monotonic()) + padding)
            due += TICK
            while (left := due - monotonic()) > 0.0:
                session.inbox.take(NEVER, left)
    else:
        session.subscribe(config.key)
        took: list[float] = []
        while len(took) < config.count + WARM_UP:
            events = session.inbox.take(1, LONGEST)
            if not events:
                raise TimeoutError(f"nothing came for {LONGEST:g} s")
            took += [at - unpack_from("<d", payload)[0] for _, _, payload, at in events]
        print(msgspec.json.encode(took[WARM_UP : WARM_UP + config.count]).decode())
    session.close()


def compare(what: str, arms: dict[str, Callable[[], pd.Series[float]]], rounds: int) -> str:
    """Measure arms in turns, and return medians (ms) and their ratios to the first arm as a table."""
    found: dict[str, list[pd.Series[float]]] = {name: [] for name in arms}
    for i in range(rounds):
        say(f"{what}, round {i + 1} of {rounds}")
        for name in list(arms)[:: 1 if i % 2 == 0 else -1]:
            found[name].append(arms[name]())
    tables = {name: pd.DataFrame(of) for name, of in found.items()}
    first = next(iter(tables.values()))
    rows = [
        (f"{what}, {name}: {column}", 1e3 * of[column].median(), ratio.median(), ratio.min(), ratio.max())
        for name, of in tables.items()
        for column, ratio in (of / first).items()
    ]
    return markdown(("what", "median (ms)", "ratio to open links", "least", "largest"), rows)


def main(
    rounds: Annotated[int, typer.Option(min=1, help="In which all take turns.")] = 5,
    end: Annotated[float, typer.Option(help="Simulated time (s) of a lock-step run.")] = 4.0,
    messages: Annotated[int, typer.Option(help="One way, in a round.")] = 250,
) -> None:
    """Measure what mutual TLS with access rules costs, and print it."""
    print(machine())
    with tempfile.TemporaryDirectory() as name:
        folder, keys = Path(name) / "logs", Path(name) / "lab"
        make_site(keys)
        for number in range(1, 10):
            issue(keys, f"inv{number}")

        def run(certificates: Path | None) -> pd.Series[float]:
            return pd.Series({"whole": lock_step(folder, end, certificates)})

        def latency(certificates: Path | None, *, rules: bool = True) -> pd.Series[float]:
            took = pd.Series(one_way(messages, certificates, rules=rules))
            return took.quantile([0.5, 0.99]).set_axis(["p50", "p99"])

        print(compare("lock-step", {"open links": lambda: run(None), "mutual TLS": lambda: run(keys)}, rounds))
        arms = {
            "open links": lambda: latency(None),
            "TLS, no access rules": lambda: latency(keys, rules=False),
            "mutual TLS": lambda: latency(keys),
        }
        print(compare("one way", arms, rounds))


if __name__ == "__main__":
    if sys.argv[1:2] == ["role"]:
        be(msgspec.json.decode(sys.stdin.buffer.readline(), type=Role))
    else:
        app = typer.Typer(add_completion=False, rich_markup_mode=None)
        app.command()(main)
        app()
