"""An intruder: a process with a session, with a certificate or without, that says what it should not."""

from __future__ import annotations

import socket
import ssl
from collections.abc import Callable
from pathlib import Path
from time import monotonic
from types import TracebackType
from typing import Any

from msgspec import structs

from gridpeers.scenarios.drivers.free_endpoint import parse_endpoint
from gridpeers.wire.codec import encode
from gridpeers.wire.driver.session import Session
from gridpeers.wire.keys import ROLES
from gridpeers.wire.messages import Message
from gridpeers.wire.trust.credentials import Credentials
from gridpeers.wire.trust.key_folder import open_credentials

PATIENCE = 60.0  # Longest wait (s) for anything


class Intruder:
    """A session at the plant's endpoint, with what credentials it shows, that is ready to publish anything."""

    def __init__(self, endpoint: str, credentials: Credentials | None) -> None:
        listen = ("tcp/127.0.0.1:0",) if credentials is None else ("tls/127.0.0.1:0",)
        self.session = Session(
            "intruder", listen=listen, connect=(endpoint,), clock="realtime", credentials=credentials
        )

    @property
    def raw(self) -> Any:
        return self.session._session  # noqa: SLF001  # a test may say anything

    def __enter__(self) -> Intruder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.session.close()

    def linked(self, least: int = 2) -> Intruder:
        end = monotonic() + PATIENCE
        while self.session.peers() < least:
            assert monotonic() < end, f"{self.session.peers()} links after {PATIENCE:g} s"
            self.session.take(1, 0.02)
        return self

    def until(self, key: str, say: Callable[[], object]) -> None:
        end = monotonic() + PATIENCE
        while True:
            say()
            if any(event[:2] == ("message", key) for event in self.session.take(1, 0.2)):
                return
            assert monotonic() < end, f"nothing on {key} after {PATIENCE:g} s"

    def says(self, *messages: tuple[str, Message]) -> None:
        for key, message in messages:
            self.session.publish(key, encode(message))


class Unruly(Credentials, frozen=True, kw_only=True):
    """Credentials of somebody who has switched off the access rules of the own process: those of others stop him."""

    def zenoh_settings(self, *, star: bool) -> tuple[dict[str, Any], dict[str, Any]]:
        return super().zenoh_settings(star=star)[0], {"enabled": False}


def credentials(folder: Path, name: str) -> Credentials:
    return Unruly(**structs.asdict(open_credentials(folder, ROLES, name)[0]))


def handshake(endpoint: str, certificate: Path | None, key: Path | None = None) -> str:
    """Return the alert with which the other end refuses a TLS handshake; empty if it takes the certificate.

    After a second without a word in Zenoh's own protocol it closes the connection without an alert.
    """
    parsed = parse_endpoint(endpoint)
    assert parsed is not None
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    if certificate is not None:
        context.load_cert_chain(certificate, key)
    with socket.create_connection((parsed.host, parsed.port), PATIENCE) as raw, context.wrap_socket(raw) as secured:
        try:
            while secured.recv(1024):  # a client hears of its refusal with the first bytes that it reads
                pass
        except ssl.SSLEOFError:
            return ""
        except ssl.SSLError as error:
            return error.reason or str(error)
        except ConnectionResetError:
            return ""
    return ""
