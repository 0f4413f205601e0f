"""A Zenoh session, set up for lock-step or for real time; the only module that knows Zenoh.

Zenoh's threads only enqueue into `Session.inbox`, and one thread, the owner's, takes the events out.
"""

from __future__ import annotations

import ctypes
import json
import os
import re
import socket
import stat
import struct
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gridpeers.wire.driver.inbox import Inbox, Stamped
from gridpeers.wire.driver.machine import limit
from gridpeers.wire.driver.zenoh_settings import ONE_THREAD, RUNTIME, Clock, zenoh_settings
from gridpeers.wire.keys import LATEST_ONLY, is_token
from gridpeers.wire.trust.credentials import Credentials, LinkCertificates
from gridpeers.wire.wording import InputError, not_importable

if TYPE_CHECKING:
    import zenoh

FIRST_LINK = 0.5
"""Longest wait (s) for the first link, to find out whether a router or a peer answers; on one host it takes 20 ms."""

_REFUSED_LINKS = "zenoh_link_tls::unicast=warn"
"""Part of Zenoh's log: failed TLS handshakes with their reasons, at most ten a second."""

_QUERY_TIMEOUT = 600.0  # Time (s) after which Zenoh forgets a query; the asking node keeps its own deadline

_stateful: set[int] = set()
"""Threads of Zenoh that keep their Python state between calls; to make it anew at each took a quarter of a tick."""


def load_zenoh(*, one_thread: bool = False) -> None:
    """Import Zenoh and choose its threads, which the first session starts; a ZENOH_RUNTIME of the user's own counts."""
    if os.environ.get("ZENOH_RUNTIME") in (None, RUNTIME, ONE_THREAD):  # a parent's choice is not this process's
        os.environ["ZENOH_RUNTIME"] = ONE_THREAD if one_thread else RUNTIME
    import zenoh  # noqa: F401


def do_not_linger() -> None:
    """Switch SO_LINGER off on this process's TCP sockets; where a process cannot list its open files, do nothing.

    Zenoh sets it to 10 s on every one, and no setting turns it off. Closing a socket with a dead path then blocks its
    thread, which serves all other links too, for that time. Without it the kernel closes in the background, and still
    delivers the sent data.
    """
    files = [int(entry.name) for entry in Path("/dev/fd").iterdir()] if Path("/dev/fd").exists() else []
    for file in files:
        with suppress(OSError):  # closed in the meantime
            if stat.S_ISSOCK(os.fstat(file).st_mode):
                with socket.socket(fileno=os.dup(file)) as same:
                    if same.family in (socket.AF_INET, socket.AF_INET6):
                        same.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 0, 0))


class SessionError(InputError):
    """Zenoh could not open a session; the message says why and what to do."""


class Session:
    """A peer of a run; raises SessionError if Zenoh is not installed, or an endpoint cannot be listened on.

    `who` names the process in errors. `listen` and `connect` are endpoints, e.g. "tcp/127.0.0.1:7447"; those to connect
    to are tried again until they answer. With `gossip` it learns of other peers from the connected ones. A peer that
    does not listen `meets_all`: it connects to every peer, not only to those of lower id. `inbox` is that of a former
    session, which this one replaces.

    A `rendezvous` is the peer to which others connect by its address. In real time any other peer becomes the
    client of a router that answers: between two peers that know each other both directly and through a router, Zenoh
    changes the way of their declarations under way, and loses some. In a `star` the rendezvous relays all messages, as
    a router: then every other session is its client, with one link.

    With `credentials` links are mutual TLS, and Zenoh lets each member send and receive what its role may.
    """

    def __init__(
        self,
        who: str,
        *,
        listen: tuple[str, ...] = (),
        connect: tuple[str, ...] = (),
        gossip: bool = True,
        clock: Clock = "simulated",
        rendezvous: bool = False,
        inbox: Inbox | None = None,
        meets_all: bool = False,
        star: bool = False,
        credentials: Credentials | None = None,
    ) -> None:
        in_star = star and not rendezvous
        try:
            load_zenoh(one_thread=in_star)
            import zenoh
        except ImportError as error:
            raise SessionError(f"{who}: {not_importable(error)}; or use --driver inprocess") from None
        if "RUST_LOG" in os.environ:  # RUST_LOG=zenoh=debug shows what Zenoh does, in the process's log
            zenoh.try_init_log_from_env()  # type: ignore[no-untyped-call]  # as zenoh declares it
        elif credentials is not None and rendezvous:
            zenoh.init_log_from_env_or(_REFUSED_LINKS)
        self.inbox = inbox or Inbox(lossless=clock == "simulated")
        self._zenoh = zenoh
        self._drops = clock == "realtime"
        self._publishers: dict[str, zenoh.Publisher] = {}
        self._declared: list[Any] = []
        self._tokens: dict[str, zenoh.LivelinessToken] = {}
        self._certificates: LinkCertificates | None = None
        if credentials is not None:
            self._certificates = LinkCertificates(credentials, relayed=in_star)
        listening, gossips = () if in_star else listen, gossip and not in_star
        config = zenoh_settings(listening, connect, gossip=gossips, clock=clock, meets_all=meets_all)
        if star and rendezvous:
            config["mode"] = "router"
            config["scouting"]["delay"] = 0  # else it waits 0.5 s for others
        if credentials is not None:
            link, config["access_control"] = credentials.zenoh_settings(star=star)
            config["transport"]["link"] |= link
        self._session = self._open(who, config)
        self._changeable = clock == "realtime" and gossip and bool(connect) and not rendezvous
        try:
            while in_star and not self._meets_router():
                pass  # a signal ends this wait, as it would not end the opening of a client
        except BaseException:
            self.close()
            raise
        if in_star or (self._changeable and self._meets_router()):
            self._session.close()  # type: ignore[no-untyped-call]  # as zenoh declares it
            self._session = self._open(who, config | {"mode": "client", "listen": {"endpoints": []}})
            self._changeable = False
        self._links: Any = None
        if clock == "realtime" or credentials is not None:
            # no callback: one during the end of Python would abort the process
            channel: Any = zenoh.handlers.RingChannel(1)
            self._links = self._session.info.declare_link_events_listener(channel, history=True)
        self.id = str(self._session.zid())
        """The instance of its process."""

    def _open(self, who: str, config: dict[str, Any]) -> zenoh.Session:
        try:
            self._config = self._zenoh.Config.from_json5(json.dumps(config))
            return self._zenoh.open(self._config)
        except self._zenoh.ZError as error:
            text = re.sub(r" at /\S+\.rs:\d+\.?", "", str(error))  # without the places in Zenoh's own source
            listen = ", ".join(config["listen"]["endpoints"])
            if "in use" in text:
                text = f"cannot listen on {listen}: the port is in use; choose another, or 0 for any free one"
            else:
                text = f"cannot open a Zenoh session (listening on {listen or 'nothing'}): {text}"
            raise SessionError(f"{who}: {text}") from None
        except BaseException as error:
            if type(error).__name__ != "PanicException":  # of Rust: Zenoh's threads have not come up
                raise
            raise SessionError(
                f"{who}: Zenoh cannot start its threads ({error}); see ulimit -n, which is {limit()} open files"
            ) from None

    def _meets_router(self) -> bool:
        linked = threading.Event()

        def on_event(event: zenoh.TransportEvent) -> None:
            linked.set()

        listener = self._session.info.declare_transport_events_listener(on_event, history=True)
        linked.wait(FIRST_LINK)
        listener.undeclare()  # type: ignore[no-untyped-call]  # as zenoh declares it
        return bool(self._session.info.routers_zid())

    def setting(self, path: str) -> Any:
        return json.loads(self._config.get_json(path))

    @property
    def misplaced(self) -> bool:
        """Whether a router answered too late for this session to be its client; then a new session is needed."""
        return self._changeable and bool(self._session.info.routers_zid())

    def take(self, needed: int, timeout: float | None) -> list[Stamped]:
        """Take the events out of the inbox, as `Inbox.take` does, and set up new links."""
        if self._links is not None and self._links.try_recv() is not None:
            if self._drops:
                do_not_linger()
            if self._certificates is not None:
                self._certificates.note(self._session.info.links())
        return self.inbox.take(needed, timeout)

    def subscribe(self, key: str) -> None:
        """Put messages on a key, without wildcards, into the inbox."""
        enqueue = self.inbox.put

        def on_sample(sample: zenoh.Sample) -> None:
            enqueue(("message", key, sample.payload.to_bytes()))

        handler = self._direct(on_sample)
        remote = self._zenoh.Locality.REMOTE
        self._declared.append(self._session.declare_subscriber(key, handler, allowed_origin=remote))

    def answer(self, key: str, payload: bytes) -> None:
        def on_query(query: zenoh.Query) -> None:
            with query:
                query.reply(key, payload)

        handler = self._direct(on_query)
        self._declared.append(self._session.declare_queryable(key, handler, complete=True))

    def fetch(self, key: str, reply_key: str = "") -> None:
        """Query a key; an answer enters the inbox like a message on that key, or on `reply_key`.

        The query goes to all queryables of the key, because one may be the stale end of a lost link.
        """
        enqueue = self.inbox.put

        def on_reply(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                enqueue(("message", reply_key or key, reply.ok.payload.to_bytes()), asked=True)

        consolidation, target = self._zenoh.ConsolidationMode.NONE, self._zenoh.QueryTarget.ALL
        handler = self._direct(on_reply)
        self._session.get(key, handler, target=target, consolidation=consolidation, timeout=_QUERY_TIMEOUT)

    def watch(self, key: str) -> None:
        """Put appearing and vanishing tokens of a run's form into the inbox, those already present included."""
        enqueue, gone = self.inbox.put, self._zenoh.SampleKind.DELETE

        def on_token(sample: zenoh.Sample) -> None:
            token = str(sample.key_expr)
            if is_token(token):
                enqueue(("vanished" if sample.kind == gone else "appeared", token, b""))

        handler = self._direct(on_token)
        self._declared.append(self._session.liveliness().declare_subscriber(key, handler, history=True))

    def hold_token(self, key: str) -> None:
        self._tokens[key] = self._session.liveliness().declare_token(key)

    def withdraw_token(self, key: str) -> None:
        self._tokens.pop(key).undeclare()  # type: ignore[no-untyped-call]  # as zenoh declares it

    def publish(self, key: str, payload: bytes) -> None:
        """Publish bytes on a key; block rather than drop, except in real time for keys of `LATEST_ONLY`."""
        publisher = self._publishers.get(key)
        if publisher is not None:
            publisher.put(payload)
        else:  # as for an answer: anybody may ask, under as many names as he likes
            self._session.put(key, payload, **self._delivery(key))

    def prepare(self, key: str) -> None:
        if key not in self._publishers:
            self._publishers[key] = self._session.declare_publisher(key, **self._delivery(key))

    def _delivery(self, key: str) -> dict[str, Any]:
        control = self._zenoh.CongestionControl
        return {
            "congestion_control": control.DROP if self.may_drop(key) else control.BLOCK,
            "allowed_destination": self._zenoh.Locality.REMOTE,
        }

    def may_drop(self, key: str) -> bool:
        """Return whether Zenoh drops a message on a key, instead of waiting, when a link is full."""
        return self._drops and key.split("/")[2] in LATEST_ONLY

    def peers(self) -> int:
        info = self._session.info
        return len(info.peers_zid()) + len(info.routers_zid())

    def take_lines(self) -> tuple[str, ...]:
        """Take out lines on links whose other end has a certificate and no access."""
        return () if self._certificates is None else self._certificates.take_lines()

    def vouches(self, name: str) -> bool:
        """Whether a link has had the certificate of a sender, the plant or an agent; True without certificates."""
        if self._certificates is None or self._certificates.vouches(name):
            return True
        self._certificates.note(self._session.info.links())  # one may have just come
        return self._certificates.vouches(name)

    def close(self) -> None:
        """Undeclare the tokens and close."""
        # close() may raise when a peer has just gone; nothing can be done about it
        with suppress(self._zenoh.ZError):
            self._session.close()  # type: ignore[no-untyped-call]  # as zenoh declares it

    def _direct(self, callback: Callable[[Any], None]) -> Any:
        def from_zenoh(item: Any) -> None:
            if (thread := threading.get_ident()) not in _stateful:
                _stateful.add(thread)
                ctypes.pythonapi.PyGILState_Ensure()  # never released: the state stays for the next call
            callback(item)

        return self._zenoh.handlers.Callback(from_zenoh, indirect=False)
