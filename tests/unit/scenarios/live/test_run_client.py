"""How a command names a run, and how its client finds the plant or says why not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from gridpeers.scenarios.live import run_client as client
from gridpeers.scenarios.live.run_address import Access, RunAddress, UsageError, address_of, return_path
from gridpeers.scenarios.live.run_client import NobodyError, RunClient
from gridpeers.wire.driver.inbox import Inbox
from gridpeers.wire.keys import Keys
from gridpeers.wire.trust.credentials import Credentials, SiteMember


@pytest.mark.parametrize("run", ["a/b", "", "a*", "$", "run 1", "x" * 65, "@run", "é"])
def test_a_run_name_that_zenoh_does_not_allow_is_refused(run: str) -> None:
    """The line names the option, the name and what is allowed."""
    with pytest.raises(UsageError, match=r"--run: .* cannot be part of a Zenoh key; use 1 to 64 letters"):
        address_of(run, None)


@pytest.mark.parametrize(("text", "said"), [
    ("192.168.1.10", "write PROTOCOL/HOST:PORT, e.g. tcp/192.168.1.10:7447"),
    ("lab:7450", "e.g. tcp/lab:7450"),
    ("", "e.g. tcp/127.0.0.1:7447"),
    ("http/lab:7447", 'no protocol "http"; protocols are tcp, tls, quic, udp'),
    ("tcp/lab:0", "a port is a number from 1 to 65535, got 0"),
    ("tcp/lab:70000", "a port is a number from 1 to 65535, got 70000"),
    ("tcp/a b:7447", "is no endpoint"),
])  # fmt: skip
def test_what_is_no_endpoint_is_told_with_what_would_be(text: str, said: str) -> None:
    """The problem, the value, and the form that is right."""
    with pytest.raises(UsageError) as told:
        address_of("lab", [text])

    assert str(told.value).startswith("--connect: ")
    assert said in str(told.value)


@pytest.mark.parametrize(("connect", "listen"), [
    (("tcp/127.0.0.1:7447",), "tcp/127.0.0.1:0"),
    (("tcp/localhost:7447", "tcp/[::1]:7447"), "tcp/127.0.0.1:0"),
    (("tcp/127.0.0.1:7447", "tcp/10.0.0.1:7447"), "tcp/0.0.0.0:0"),
    (("tcp/[fd00::1]:7447",), "tcp/[::]:0"),
])  # fmt: skip
def test_who_connects_to_another_host_can_be_reached_from_there(connect: tuple[str, ...], listen: str) -> None:
    """On the loopback as long as everything is on it, on every address otherwise."""
    assert return_path(connect) == (listen,)


@pytest.mark.parametrize(("endpoint", "words"), [
    ("tls/127.0.0.1:7447", ["--keys", "lab"]),
    ("tls/0.0.0.0:7500", ["--connect", "tls/127.0.0.1:7500", "--keys", "lab"]),
    ("tls/[::]:7447", ["--connect", "tls/[::1]:7447", "--keys", "lab"]),
    ("tls/10.0.0.1:7447", ["--connect", "tls/10.0.0.1:7447", "--keys", "lab"]),
])  # fmt: skip
def test_the_options_that_find_a_run_say_what_is_not_the_default(endpoint: str, words: list[str]) -> None:
    """`up` names its commands with them; with certificates the default endpoint is tls."""
    address = RunAddress(run="gridpeers", connect=(endpoint,), access=Access(keys=Path("lab")))

    assert address.words == words


class Clock:
    """Time that passes while somebody waits, and whose token comes meanwhile."""

    def __init__(self, comes: dict[float, str]) -> None:
        self.now, self._comes = 0.0, comes

    def take(self, count: int, seconds: float) -> list[tuple[str, str, bytes, float]]:
        """Wait as a session does: until somebody comes, or to the end."""
        end = self.now + seconds
        due = [t for t in self._comes if t <= end]
        self.now = min(due) if due else end
        return [("appeared", Keys(self._comes.pop(self.now)).alive_plant(1), b"", self.now)] if due else []


Waiting = Callable[..., list[str]]

INV1 = SiteMember(name="inv1", role="agent")
SHOWN = Credentials(own=INV1, ca="ca.pem", certificate="inv1.pem", key="inv1.key", members=(INV1,))


@pytest.fixture
def waiting(monkeypatch: pytest.MonkeyPatch) -> Waiting:
    """Waits for the plant of run lab and gives what was told, each with its time, the last without if all ended ill."""

    def wait(
        comes: dict[float, str],
        longest: float,
        credentials: Credentials | None = None,
        links: int = 1,
        strangers: tuple[str, ...] = (),
    ) -> list[str]:
        clock, told, unseen, lines = Clock(comes), list[str](), [*strangers], list[str]()

        def looks(name: str) -> bool:
            """Look at the links, as a session does that has no certificate of a name yet."""
            while unseen:
                lines.append(unseen.pop())
            return bool(links) and not strangers

        class Session:
            """Stands for Zenoh."""

            id, misplaced, inbox = "1", False, Inbox()
            subscribe = watch = close = staticmethod(lambda *_, **__: None)
            peers = staticmethod(lambda: links)
            take = staticmethod(clock.take)
            take_lines = staticmethod(lambda: tuple(lines.pop(0) for _ in range(len(lines))))
            vouches = staticmethod(looks)

        monkeypatch.setattr(client, "Session", lambda *_, **__: Session())
        monkeypatch.setattr(client, "monotonic", lambda: clock.now)
        try:
            where = replace(address_of("lab", None), credentials=credentials)
            RunClient(where).find_plant(longest, lambda line: told.append(f"{clock.now:g}: {line}"))
        except NobodyError as error:
            told.append(str(error))
        return told

    return wait


def test_a_plant_of_another_run_is_told_with_each_reminder(waiting: Waiting) -> None:
    """A --run that no run has is reported during the wait, which goes on, as the run may yet start."""
    told = waiting({0.5: "lab2", 3.0: "lab"}, 60.0)

    start = "gridpeers up SCENARIO --run lab starts one"
    told_at = {1: 59, 2: 58}
    assert told == [
        f"{t}: no plant yet of run lab at tcp/127.0.0.1:7447 (runs there: lab2); {start}; {left} s left"
        for t, left in told_at.items()
    ]


STRANGER = "a link to tls/127.0.0.1:7447: its certificate is revoked; no message passes"
"""A line that a session gives once."""


def test_a_link_without_access_is_the_reason_at_the_end(waiting: Waiting) -> None:
    """A revoked certificate of either end, which TLS accepts: the plant can say nothing to its holder."""
    *_, own = waiting({}, 10.0, SHOWN)
    *_, other = waiting({}, 10.0, SHOWN, strangers=(STRANGER,))

    said = "no plant of run lab at tcp/127.0.0.1:7447 within 10 s: "
    assert own.startswith(f"{said}the plant at tcp/127.0.0.1:7447 accepts the link, but no message passes: ")
    assert "revokes or lacks inv1" in own
    assert other == said + STRANGER


def test_a_refused_certificate_ends_the_wait(waiting: Waiting, monkeypatch: pytest.MonkeyPatch) -> None:
    """It would be refused for ever; open links are told to show one."""
    monkeypatch.setattr(client, "tls_refusal", lambda *_: "asks for a certificate")

    assert waiting({}, 60.0, None, 0) == [
        "tcp/127.0.0.1:7447 asks for a certificate; use --keys DIR and tls/127.0.0.1:7447 "
        "(docs/how-to/several-hosts.md)"
    ]
    assert waiting({}, 60.0, SHOWN, 0)[0].endswith(
        "asks for a certificate; give the folder of its site by --keys, or the endpoint of your plant by --connect "
        "(docs/how-to/several-hosts.md)"
    )
