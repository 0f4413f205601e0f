"""Client of a command to a run: it finds the plant or says why not, requests and listens. No run depends on it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from time import monotonic

from gridpeers.scenarios.drivers.free_endpoint import parse_endpoint
from gridpeers.scenarios.live.run_address import PROBE, RunAddress, accepting
from gridpeers.scenarios.live.run_monitor import RunTokens
from gridpeers.wire.codec import RejectedError, decode
from gridpeers.wire.driver.command_line import command_line
from gridpeers.wire.driver.session import Session
from gridpeers.wire.keys import ANY_ALIVE_PLANT, Keys
from gridpeers.wire.messages import PLANT, AgentStatus, Answer, AnyMessage, LinkAcknowledgement, Telemetry
from gridpeers.wire.trust.key_folder import tls_refusal


class PlantSearch:
    def __init__(self, where: RunAddress, session: Session) -> None:
        self._where, self._session = where, session
        self._told: set[str] = set()
        self._strangers: list[str] = []
        """Lines on links to ends without access. The session gives each once; the error at the end needs them too."""

    def refused(self) -> str:
        """Return why no link will come, if every endpoint refuses one; else the empty string."""
        if self._session.peers():
            return ""
        refusals = [_refusal(text, self._where) for text in self._where.connect]
        return "\n".join(refusals) if all(refusals) else ""

    def news(self, runs: Collection[str]) -> list[str]:
        """Return what is wrong with links that are there, each sentence once; `runs` are those that were heard of."""
        lines = [line for line in self._faults(runs) if line not in self._told]
        self._told.update(lines)
        return lines

    def _faults(self, runs: Collection[str]) -> list[str]:
        credentials = self._where.credentials
        if credentials is None:
            return []
        vouched = self._session.vouches(PLANT)  # first: it looks at links that have just come, and notes their lines
        self._strangers += self._session.take_lines()
        if runs or not vouched:
            return [*self._strangers]
        own = credentials.own
        return [
            *self._strangers,
            f"the plant at {self._at} takes the link, but nothing passes on it: it is still being built, or its "
            f"members.json revokes or lacks the certificate of {own.name}, which its output says; gridpeers keys issue "
            f"{own.name} --role {own.role}, where the site was made, gives {own.name} a new one",
        ]

    def failure(self, wait: float, runs: Collection[str], others: Collection[str]) -> str:
        """Return why no plant was found within a wait (s).

        `runs` are those whose plants have been heard of, and `others` those of them that were not sought.
        """
        if not self._session.peers():
            return self.refused() or self._no_link(wait)
        there = f"runs there: {', '.join(sorted(others))}" if others else ""
        if faults := self._faults(runs):
            beside = f" ({there})" if there else ""
            return f"no plant of {self._where} within {wait:g} s{beside}: {'; '.join(faults)}"
        start = command_line("plant", "SCENARIO", "--run", self._where.run, *self._where.access.words)
        return (
            f"no plant of {self._where} within {wait:g} s ({there or 'no other run is there either'}); start one "
            f"({start}), or give another name by --run"
        )

    @property
    def _at(self) -> str:
        return ", ".join(self._where.connect)

    def _no_link(self, wait: float) -> str:
        where = self._where
        mute = accepting(where.connect)
        if mute and where.credentials is not None:
            return (
                f"something listens at {', '.join(mute)} and has made no link within {wait:g} s: it is of a run "
                "without certificates, no plant, or a frozen one, which kill -CONT lets go on; say by --connect where "
                "the plant is"
            )
        if mute:
            return (
                f"something listens at {', '.join(mute)} but has said nothing within {wait:g} s; if it is a frozen "
                "plant, kill -CONT lets it go on, else end it by its process id; if it is something else, say by "
                "--connect where the plant is; a plant with certificates asks for --keys DIR and tls/..."
            )
        return (
            f"nothing answers at {self._at} within {wait:g} s; start a plant there "
            f"({command_line('plant', 'SCENARIO', *where.access.words)}), or say by --connect where it is"
        )


def _refusal(text: str, where: RunAddress) -> str:
    """Return why an endpoint and this process make no link; empty if they may."""
    endpoint = parse_endpoint(text)
    if endpoint is None or not endpoint.connects:
        return ""
    refusal = tls_refusal(endpoint.host.strip("[]"), endpoint.port, where.credentials, PROBE)
    if not refusal:
        return ""
    if where.credentials is None:
        advice = f"say --keys DIR and {endpoint._replace(protocol='tls')}"
    else:
        advice = "say by --keys the folder of its site, or by --connect where the plant of this site is"
    return f"what listens at {text} {refusal}; {advice} (docs/security.md)"


VISITOR = "visitor"

REMINDER = 2.0
"""Time (s) after which a wait is reported again, then after twice as long, and so on."""

RENEWAL = 2.0
"""Time (s) between two checks of the session."""

FIRST_LOOK = 1.0
"""Time (s) after which it is checked first: a link takes some 50 ms, on a busy machine more."""


class NobodyError(ValueError):
    """A run, plant or inverter is not there; the message says where the search was, how long, and what to do."""


class RunClient:
    """A session at a run.

    It meets the agents too, to hear what they publish, if so wished; they connect to `listen` after a cut. The plant
    alone is enough to ask it.
    """

    def __init__(self, where: RunAddress, *, meet_agents: bool = False, listen: tuple[str, ...] = ()) -> None:
        self.where, self.keys = where, Keys(where.run)
        self._meet_agents, self._listen = meet_agents, listen
        self._heard: list[str] = []
        self._open()

    def _open(self) -> None:
        self._tokens = RunTokens(self.where.run)
        self._session = Session(
            VISITOR,
            listen=self._listen,
            connect=self.where.connect,
            clock="wall",
            meets_all=self._meet_agents,
            credentials=self.where.credentials,
        )
        self._session.inbox.is_noted = self._tokens.is_noted
        for key in (self.keys.answer(self._session.id), *self._heard):
            self._session.subscribe(key)
        self._session.watch(self.keys.any_alive)
        self._session.watch(ANY_ALIVE_PLANT)

    @property
    def moved(self) -> bool:
        return self._session.moved

    def renew(self) -> None:
        """Open a new session, as the old one does not bring the messages that it should."""
        self._session.close(replaced=True)
        self._open()

    def __enter__(self) -> RunClient:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self._session.close()

    @property
    def plant(self) -> bool:
        return bool(self.epochs)

    @property
    def epochs(self) -> set[int]:
        return self._tokens.epochs

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
        of_plant = message.sender == PLANT and message.epoch in self.epochs
        match self.keys.parts(key), message:
            case ("status", name), AgentStatus():
                believed = message.sender == name
            case ("telemetry",), Telemetry():
                believed = of_plant
            case ("answer", _), Answer():
                believed = of_plant
            case ("answer", _), LinkAcknowledgement():
                believed = True
            case _:
                believed = False
        return message if believed else None

    @property
    def id(self) -> str:
        """Id of the session, in the key of its answers."""
        return self._session.id

    def listen(self, key: str) -> None:
        self._heard.append(key)
        self._session.subscribe(key)

    def fetch(self, key: str) -> None:
        """Ask a queryable; its answers come in as messages on that key."""
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

    def find_plant(self, wait: float, tell: Callable[[str], None] | None = None) -> None:
        """Wait for the plant of the run, for `wait` (s) at most.

        `tell` hears for what one waits: ever more rarely, and at once if plants of other runs are there, or if the
        plant takes the link and lets nothing pass on it. NobodyError if there is none in time; at once if nobody there
        accepts the other's certificate.
        """
        began = monotonic()
        look, reminder = began + FIRST_LOOK, REMINDER
        strangers: set[str] = set()
        search = PlantSearch(self.where, self._session)
        while True:
            pause = min(look, began + reminder, began + wait) - monotonic()
            self.until(lambda: self.plant or not self._others <= strangers, pause)
            now = monotonic()
            if self.plant:
                return
            lines = []
            if not self._others <= strangers:
                strangers.update(self._others)
                lines.append(f"no plant yet of {self.where} (runs there: {', '.join(sorted(strangers))}); waits on")
            if now - began >= wait:
                raise NobodyError(search.failure(wait, self.runs, self._others))
            if now >= look:
                look = now + RENEWAL
                if refused := search.refused():
                    raise NobodyError(refused)
                if self._session.misplaced:
                    self.renew()
                    search = PlantSearch(self.where, self._session)
            if now - began >= reminder:
                reminder *= 2.0
                lines.append(f"no plant yet of {self.where}; {now - began:.0f} of {wait:g} s waited")
                lines += search.news(self.runs)
            if tell is not None:
                for line in lines:
                    tell(line)

    @property
    def _others(self) -> set[str]:
        return self.runs - {self.where.run}
