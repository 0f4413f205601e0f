"""Why a TLS handshake fails, as each end sees it: real handshakes with a server of this process."""

from __future__ import annotations

import shutil
import socket
import ssl
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from gridpeers.wire.trust.credentials import Credentials, Member
from gridpeers.wire.trust.tls_refusal import tls_refusal

pytest.importorskip("cryptography", reason="certificates need the extra keys")

PATIENCE = 60.0


@pytest.fixture(scope="module")
def sites(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sites lab and far, another one of the name lab, and late: lab with a plant and an agent that have expired."""
    from gridpeers.wire.trust.site_authority import issue, make_site

    folder = tmp_path_factory.mktemp("sites")
    for name in ("lab", "far", "other/lab"):
        (folder / name).parent.mkdir(exist_ok=True)
        make_site(folder / name)
        issue(folder / name, "inv1")
    shutil.copytree(folder / "lab", folder / "late")
    before = datetime.now(UTC) - timedelta(days=2)
    issue(folder / "late", "plant", "plant", days=1.0, now=before)
    issue(folder / "late", "inv1", days=1.0, now=before)
    return folder


def _shown(site: Path, ca: Path | None = None) -> Credentials:
    """Return what inv1 of a site shows, and whose certificates it accepts: its own site's if left out."""
    certificate, key = site / "inv1.pem", site / "inv1.key"
    own = Member(name="inv1", role="agent")
    return Credentials(own=own, ca=str(ca or site / "ca.pem"), certificate=str(certificate), key=str(key), members=())


@contextmanager
def _served(site: Path) -> Iterator[int]:
    """Yield the port of a plant's end of mutual TLS, which says nothing and closes once the other does."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(site / "plant.pem", site / "plant.key")
    context.load_verify_locations(site / "ca.pem")
    context.verify_mode = ssl.CERT_REQUIRED
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def serve() -> None:
            raw, _ = listening.accept()
            with raw, suppress(OSError):  # of a handshake that fails
                context.wrap_socket(raw, server_side=True).close()

        thread = threading.Thread(target=serve)
        thread.start()
        yield listening.getsockname()[1]
        thread.join(PATIENCE)


@pytest.mark.parametrize(
    ("plant", "agent", "said"),
    [
        ("lab", "lab", ""),
        ("far", "lab", "shows a certificate that {ca} has not signed: it is of another site"),
        ("other/lab", "lab", "shows a certificate that {ca} has not signed: it is of another site"),
        ("late", "lab", "shows a certificate that has expired; gridpeers keys issue renews it"),
        ("lab", "late", "does not accept the certificate of inv1: it has expired by the clock there"),
    ],
)
def test_the_end_that_refuses_and_its_reason_are_told(sites: Path, plant: str, agent: str, said: str) -> None:
    """Two sites of the same name are two; where both ends agree nothing is said."""
    shown = _shown(sites / agent)
    with _served(sites / plant) as port:
        told = tls_refusal("127.0.0.1", port, shown, PATIENCE)

    assert told.startswith(said.format(ca=shown.ca)) if said else told == ""


def test_a_certificate_that_the_other_end_does_not_know_is_told(sites: Path) -> None:
    """A folder with the ca.pem of one site and the certificate of another, so that only the plant can refuse."""
    for other in ("far", "other/lab"):
        with _served(sites / "lab") as port:
            told = tls_refusal("127.0.0.1", port, _shown(sites / other, sites / "lab" / "ca.pem"), PATIENCE)

        assert told == "does not accept the certificate of inv1: by the ca.pem there it is of another site"


def test_open_links_are_told_that_a_certificate_is_asked_for(sites: Path) -> None:
    """Whoever has left out --keys learns it from the plant that has them."""
    with _served(sites / "lab") as port:
        assert tls_refusal("127.0.0.1", port, None, PATIENCE) == "asks for a certificate"


@pytest.mark.parametrize(
    ("alert", "said"), [(40, "asks for a certificate"), (116, "asks for a certificate"), (70, ""), (80, ""), (112, "")]
)
def test_of_an_alert_to_open_links_only_those_that_ask_for_a_certificate_are_told(alert: int, said: str) -> None:
    """A version of TLS (70), an error (80) or a name (112) that does not suit is no matter of --keys."""
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def refuse() -> None:
            raw, _ = listening.accept()
            with raw, suppress(OSError):
                raw.recv(65536)
                raw.sendall(bytes((21, 3, 3, 0, 2, 2, alert)))
                raw.recv(1)  # until the other end closes

        thread = threading.Thread(target=refuse)
        thread.start()
        told = tls_refusal("127.0.0.1", listening.getsockname()[1], None, PATIENCE)
        thread.join(PATIENCE)

    assert told == said


def test_an_end_that_talks_on_does_not_hold_the_command(sites: Path) -> None:
    """Of 64 MB that it sends the first byte is enough: the connection is closed, and the rest has no reader."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(sites / "lab" / "plant.pem", sites / "lab" / "plant.key")
    sent = 0
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def talk() -> None:
            nonlocal sent
            raw, _ = listening.accept()
            with suppress(OSError), context.wrap_socket(raw, server_side=True) as secured:
                for _ in range(64):
                    secured.sendall(bytes(2**20))
                    sent += 1

        thread = threading.Thread(target=talk)
        thread.start()
        told = tls_refusal("127.0.0.1", listening.getsockname()[1], _shown(sites / "lab"), PATIENCE)
        thread.join(PATIENCE)

    assert (told, sent < 64) == ("", True)


def test_who_shows_an_expired_certificate_may_have_an_expired_authority(sites: Path) -> None:
    """OpenSSL does not say which one it is: the advice has both, with the file to look at."""
    shown = _shown(sites / "lab")
    with _served(sites / "late") as port:
        told = tls_refusal("127.0.0.1", port, shown, PATIENCE)

    assert told.endswith(f"unless {shown.ca} has expired too: then gridpeers keys init makes a new site")


def test_silence_is_no_refusal(sites: Path) -> None:
    """A frozen plant, or one that is gone, may come back: nothing is said of certificates."""
    with socket.create_server(("127.0.0.1", 0)) as frozen:
        port = frozen.getsockname()[1]
        assert tls_refusal("127.0.0.1", port, _shown(sites / "lab"), 0.05) == ""
    assert tls_refusal("127.0.0.1", port, _shown(sites / "lab"), PATIENCE) == ""
