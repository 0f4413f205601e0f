"""Client of a command to a run: it finds the plant or says why not, requests and listens. No run depends on it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from time import monotonic

from gridpeers.scenarios.drivers.free_endpoint import parse_endpoint
from gridpeers.scenarios.live.run_address import RUN, RunAddress
from gridpeers.scenarios.live.run_monitor import RunTokens
from gridpeers.wire.codec import RejectedError, decode
from gridpeers.wire.driver.command_line import command_line
from gridpeers.wire.driver.session import Session
from gridpeers.wire.keys import ANY_ALIVE_PLANT, Keys
from gridpeers.wire.messages import PLANT, AgentStatus, Answer, AnyMessage, LinkAcknowledgement, Telemetry
from gridpeers.wire.trust.key_folder import tls_refusal
from gridpeers.wire.wording import InputError

REMINDER = 1.0  # Time (s) after which a wait is reported; it doubles with each report
PROBE = 1.0  # Longest wait (s) for each step of a TLS handshake

FIRST_LOOK, RENEWAL = 1.0, 2.0  # Time (s) until the session is checked first, and between two checks


class NobodyError(InputError):
    """A run, plant or inverter was not found; the message says where, after how long, and the next step."""


class RunClient:
    """A session at a run; with `meet_agents` it hears the agents too, which connect to `listen` after a cut."""

    def __init__(self, where: RunAddress, *, meet_agents: bool = False, listen: tuple[str, ...] = ()) -> None:
        self.where, self.keys = where, Keys(where.run)
        self._meet_agents, self._listen = meet_agents, listen
        self._heard: list[str] = []
        self._open()

    def _open(self) -> None:
        self._tokens = RunTokens(self.where.run)
        self._session = Session(
            "visitor",
            listen=self._listen,
            connect=self.where.connect,
            clock="realtime",
            meets_all=self._meet_agents,
            credentials=self.where.credentials,
        )
        for key in (self.keys.answer(self._session.id), *self._heard):
            self._session.subscribe(key)
        self._session.watch(self.keys.any_alive)
        self._session.watch(ANY_ALIVE_PLANT)

    def renew(self) -> None:
        """Open a new session, because the old one does not bring its messages."""
        self.close()
        self._open()

    def __enter__(self) -> RunClient:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self._session.close()

    @property
    def plant(self) -> bool:
        return bool(self._tokens.epochs)

    @property
    def present(self) -> list[str]:
        return list(self._tokens.agents)

    @property
    def runs(self) -> set[str]:
        return self._tokens.runs

    def read(self, key: str, payload: bytes) -> AnyMessage | None:
        """Return the message that came on a key; None if it is none, or not of the sender that the key names.

        A message of the plant must be of the one that is there. The plant has checked the messages that it passes on.
        """
        try:
            message = decode(payload)
        except RejectedError:  # nothing depends on a visitor
            return None
        of_plant = message.sender == PLANT and message.epoch in self._tokens.epochs
        match self.keys.parts(key), message:
            case ("status", name), AgentStatus():
                believed = message.sender == name
            case (("telemetry",), Telemetry()) | (("answer", _), Answer()):
                believed = of_plant
            case ("answer", _), LinkAcknowledgement():
                believed = True
            case _:
                believed = False
        return message if believed else None

    @property
    def id(self) -> str:
        return self._session.id

    def listen(self, key: str) -> None:
        self._heard.append(key)
        self._session.subscribe(key)

    def fetch(self, key: str) -> None:
        self._session.fetch(key)

    def publish(self, key: str, payload: bytes) -> None:
        self._session.publish(key, payload)

    def take(self, seconds: float) -> Iterator[tuple[str, bytes, float]]:
        """Wait (s) for messages or tokens; yield key, bytes and time of arrival (s, monotonic) of each message."""
        for kind, key, payload, at in self._session.take(1, max(0.0, seconds)):
            if kind == "message":
                yield key, payload, at
            elif kind == "appeared":
                self._tokens.appeared(key)
            elif kind == "vanished":
                self._tokens.vanished(key)

    def until(self, done: Callable[[], bool], seconds: float) -> bool:
        """Wait (s) until a condition holds; return whether it does. Messages that come meanwhile are dropped."""
        end = monotonic() + seconds
        while not done():
            left = end - monotonic()
            if left <= 0.0:
                return False
            for _ in self.take(left):
                pass
        return True

    def find_plant(self, wait: float, tell: Callable[[str], None] = lambda line: None) -> None:
        """Wait for the plant of the run, for `wait` (s) at most; `tell` gets a line now and then.

        NobodyError if there is no plant in time; at once if nobody there accepts the other's certificate.
        """
        began = monotonic()
        look, reminder = FIRST_LOOK, REMINDER
        while not self.until(lambda: self.plant, began + min(look, reminder, wait) - monotonic()):
            waited = monotonic() - began
            if waited >= wait:
                raise NobodyError(self._failure(wait))
            if waited >= look:
                look = waited + RENEWAL
                if refused := self._refused():
                    raise NobodyError(refused)
                if self._session.misplaced:
                    self.renew()
            if waited >= reminder:
                reminder *= 2.0
                start = command_line("up", "SCENARIO", *([] if self.where.run == RUN else ["--run", self.where.run]))
                tell(f"no plant yet of {self.where}{self._runs_there}; {start} starts one; {wait - waited:.0f} s left")

    @property
    def _runs_there(self) -> str:
        others = sorted(self.runs - {self.where.run})
        return f" (runs there: {', '.join(others)})" if others else ""

    def _refused(self) -> str:
        """Return why no link is possible, if every endpoint refuses one; else an empty string."""
        if self._session.peers():
            return ""
        refusals = [_refusal(text, self.where) for text in self.where.connect]
        return "\n".join(refusals) if all(refusals) else ""

    def _link_faults(self) -> str:
        """Return why links without access bring no messages; empty if they have access, or without certificates."""
        if (credentials := self.where.credentials) is None:
            return ""
        own, vouched = credentials.own, self._session.vouches(PLANT)  # it looks at new links, and notes their lines
        silent = (
            f"the plant at {', '.join(self.where.connect)} accepts the link, but no message passes: it is still being "
            f"built, or its members.json revokes or lacks {own.name} (see its output); "
            f"gridpeers keys issue {own.name} --role {own.role}, in the folder of the site, issues a new certificate"
        )
        return "; ".join([*self._session.take_lines(), *([silent] if vouched and not self.runs else [])])

    def _failure(self, wait: float) -> str:
        where = self.where
        if self._session.peers():
            missing = f"no plant of {where} within {wait:g} s{self._runs_there}"
            if faults := self._link_faults():
                return f"{missing}: {faults}"
            start = command_line("plant", "SCENARIO", "--run", where.run, *where.access.words)
            return f"{missing}; start one ({start}), or name another run by --run"
        if refused := self._refused():
            return refused
        start = command_line("plant", "SCENARIO", *where.access.words)
        return (
            f"nothing answers at {', '.join(where.connect)} within {wait:g} s; start a plant there ({start}), "
            "or name its endpoint by --connect; kill -CONT wakes a frozen plant"
        )


def _refusal(text: str, where: RunAddress) -> str:
    endpoint = parse_endpoint(text)
    if endpoint is None or not endpoint.connects:
        return ""
    if not (refusal := tls_refusal(endpoint.host.strip("[]"), endpoint.port, where.credentials, PROBE)):
        return ""
    advice = "give the folder of its site by --keys, or the endpoint of your plant by --connect"
    if where.credentials is None:
        advice = f"use --keys DIR and {endpoint._replace(protocol='tls')}"
    return f"{text} {refusal}; {advice} (docs/how-to/several-hosts.md)"
