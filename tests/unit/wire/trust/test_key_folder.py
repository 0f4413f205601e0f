from __future__ import annotations

import re
import shutil
import socket
import ssl
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from gridpeers.wire.trust.credentials import Credentials, SiteMember

pytest.importorskip("cryptography", reason="certificates need the extra keys")

from gridpeers.wire.trust.key_folder import KeysError, open_credentials, read_list, tls_refusal
from gridpeers.wire.trust.site_authority import issue, make_site, revoke

NOW = datetime(2026, 11, 23, 12, tzinfo=UTC)


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    folder = tmp_path / "lab"
    make_site(folder, now=NOW)
    for name in ("inv1", "inv2"):
        issue(folder, name, now=NOW)
    return folder


def refusal(folder: Path, name: str = "inv1", now: datetime = NOW) -> str:
    with pytest.raises(KeysError) as refused:
        open_credentials(folder, ("agent",), name, now=now)
    text = str(refused.value)
    assert "\n" not in text
    return text


def test_a_site_is_private_and_its_members_are_listed(lab: Path) -> None:
    """The folder is 0700 and each key 0600, and git ignores them; the list names all members."""
    assert lab.stat().st_mode & 0o777 == 0o700
    assert (lab / ".gitignore").read_text(encoding="utf-8") == "*\n"
    assert {key.stat().st_mode & 0o777 for key in lab.glob("*.key")} == {0o600}
    assert [(member.name, member.role) for member in read_list(lab).members] == [
        ("plant", "plant"), ("operator", "operator"), ("viewer", "viewer"), ("inv1", "agent"), ("inv2", "agent"),
    ]  # fmt: skip


def test_the_certificate_of_a_member_signs_no_other(lab: Path) -> None:
    """Nobody accepts a certificate that a member signed with its own key."""
    from cryptography import x509

    extensions = x509.load_pem_x509_certificate((lab / "inv1.pem").read_bytes()).extensions

    assert not extensions.get_extension_for_class(x509.BasicConstraints).value.ca
    assert not extensions.get_extension_for_class(x509.KeyUsage).value.key_cert_sign


def test_a_host_needs_four_files_and_no_more(lab: Path, tmp_path: Path) -> None:
    """Authority, list, own certificate, own key; the authority's key stays at home."""
    host = tmp_path / "host"
    host.mkdir()
    for name in ("ca.pem", "members.json", "inv1.pem", "inv1.key"):
        shutil.copy2(lab / name, host)

    credentials, note = open_credentials(host, ("agent",), "inv1", now=NOW)

    assert (credentials.own.common_name, note) == ("agent:inv1", "")
    with pytest.raises(KeysError, match=r"ca\.key: is missing; certificates are issued and revoked where the site was"):
        issue(host, "inv3")


def test_without_a_name_the_first_role_counts_whose_key_is_there(lab: Path) -> None:
    """A command uses the operator's certificate. It uses the viewer's if there is no other, or if that was revoked."""

    def first(folder: Path) -> str:
        return open_credentials(folder, ("operator", "viewer"), now=NOW)[0].own.name

    host = shutil.copytree(lab, lab.parent / "host")
    assert first(lab) == first(host) == "operator"
    revoke(lab, "operator")
    assert not (lab / "operator.key").exists()
    shutil.copy2(lab / "members.json", host)
    assert first(lab) == first(host) == "viewer"


def of_another_site(lab: Path, name: str) -> None:
    other = lab.parent / "other" / "lab"
    make_site(other, now=NOW)
    issue(other, "inv1", now=NOW)
    shutil.copy2(other / name, lab)


WRONG: dict[str, tuple[Callable[[Path], object], str]] = {
    "no folder": (shutil.rmtree, r"lab: does not exist; gridpeers keys init .*lab makes a folder of keys"),
    "a file": (lambda lab: (shutil.rmtree(lab), lab.write_text("")), r"lab: does not exist"),
    "no key": (lambda lab: (lab / "inv1.key").unlink(), r"inv1.key: is missing; copy it"),
    "no certificate": (lambda lab: (lab / "inv1.pem").unlink(), r"inv1.pem: is missing; copy it"),
    "no list": (lambda lab: (lab / "members.json").unlink(), r"members.json: is missing; copy it"),
    "no authority": (lambda lab: (lab / "ca.pem").unlink(), r"ca.pem: is missing; copy it"),
    "readable": (lambda lab: (lab / "inv1.key").chmod(0o644), r"inv1.key: others may .* \(mode 0644\); chmod 600 "),
    "another site": (lambda lab: of_another_site(lab, "inv1.pem"), r"inv1.pem: is not signed by .*: it is of another"),
    "no authority of ours": (lambda lab: of_another_site(lab, "ca.pem"), r"members.json: is not signed by ca.pem"),
    "a key of another": (lambda lab: shutil.copy2(lab / "inv2.key", lab / "inv1.key"), r"is not the key of inv1.pem"),
    "another name": (lambda lab: shutil.copy2(lab / "inv2.pem", lab / "inv1.pem"), r'"agent:inv2", not of "agent:in'),
    "no PEM": (lambda lab: (lab / "inv1.pem").write_text("x"), r"inv1.pem: is not a certificate in PEM; copy it"),
    "no private key": (lambda lab: (lab / "inv1.key").write_text("x"), r"inv1.key: is no private key: .*; copy it"),
    "no JSON": (lambda lab: (lab / "members.json").write_text("x"), r"members.json: cannot be read: .*; copy it"),
    "revoked": (lambda lab: revoke(lab, "inv1"), r"inv1.pem: was revoked; gridpeers keys issue inv1 gives inv1 a new"),
}


@pytest.mark.parametrize("what", WRONG)
def test_every_wrong_file_is_refused_in_one_line(lab: Path, what: str) -> None:
    change, pattern = WRONG[what]
    change(lab)

    assert re.search(pattern, refusal(lab))


def test_time_decides_whether_a_certificate_counts(lab: Path) -> None:
    """It is refused before its start and after its end. In its last 30 days a note gives its end."""
    late = NOW + timedelta(days=366)
    assert "inv1.pem: expired on 2027-11-23 12:00 UTC; gridpeers keys issue inv1 makes a new one" in refusal(
        lab, now=late
    )
    assert "is valid from 2026-11-23 11:55 UTC, and the clock of this host shows 2026-11-22 12:00" in refusal(
        lab, now=NOW - timedelta(days=1)
    )
    soon = open_credentials(lab, ("agent",), "inv1", now=NOW + timedelta(days=340))[1]
    assert soon == "the certificate of inv1 ends on 2027-11-23 12:00 UTC; gridpeers keys issue inv1 renews it"


def test_a_name_and_a_role_that_do_not_fit_are_refused(lab: Path) -> None:
    """An unknown name, a viewer as an agent, a second role for a name, and an invalid name are refused."""
    assert 'no certificate was issued to "inv7"; those of role agent: inv1, inv2; gridpeers keys issue inv7' in refusal(
        lab, "inv7"
    )
    assert "viewer has the role viewer; this needs the role agent" in refusal(lab, "viewer")
    for name, role, text in (
        ("inv1", "viewer", "inv1: already has the role agent; give the viewer another name"),
        ("a/b", "agent", '"a/b" cannot be a name'),
        ("..", "agent", r'"\.\." cannot be a name.*neither a dot nor a dash'),
        ("-v", "agent", '"-v" cannot be a name'),
        ("Ca.Key", "viewer", '"Ca.Key" cannot be a name: a file of the site has it'),
        ("x" * 60, "agent", "is too long for a certificate"),
    ):
        with pytest.raises(KeysError, match=text):
            issue(lab, name, role)  # type: ignore[arg-type]


def test_a_new_certificate_after_a_revoked_one_has_another_common_name(lab: Path) -> None:
    """The revoked one could be used again otherwise; a renewal keeps the name."""
    assert issue(lab, "inv1", now=NOW).common_name == "agent:inv1"
    revoke(lab, "inv1")
    assert issue(lab, "inv1", now=NOW).common_name == "agent:inv1:2"
    assert open_credentials(lab, ("agent",), "inv1", now=NOW)[0].own.generation == 2
    with pytest.raises(KeysError, match=r'no certificate was issued to "inv7"; certificates exist of'):
        revoke(lab, "inv7")


def shown(site: Path, ca: Path | None = None) -> Credentials:
    own = SiteMember(name="inv1", role="agent")
    certificate, key = str(site / "inv1.pem"), str(site / "inv1.key")
    return Credentials(own=own, ca=str(ca or site / "ca.pem"), certificate=certificate, key=key, members=())


@contextmanager
def served(site: Path) -> Iterator[int]:
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
        thread.join(60.0)


def test_the_end_that_refuses_a_link_and_its_reason_are_told(tmp_path: Path) -> None:
    """Two sites of one name stay distinct. If both ends agree, or nobody answers, there is no message."""
    lab, other, late = tmp_path / "lab", tmp_path / "other" / "lab", tmp_path / "late"
    for site in (lab, other):
        make_site(site)
        issue(site, "inv1")
    shutil.copytree(lab, late)
    for name in ("plant", "inv1"):
        issue(late, name, days=1.0, now=datetime.now(UTC) - timedelta(days=2))  # noqa: TID251
    for plant, agent, said in (
        (lab, shown(lab), "$"),
        (other, shown(lab), "shows a certificate that .*lab/ca.pem does not accept "),
        (late, shown(lab), r"shows a certificate that .*lab/ca.pem does not accept \(certificate has expired\)"),
        (lab, shown(late), r"does not accept the certificate of inv1 \(expired by the clock of that host"),
        (lab, shown(other, lab / "ca.pem"), "does not accept the certificate of inv1 .*, of another site"),
        (lab, None, "asks for a certificate"),
    ):
        with served(plant) as port:
            assert re.match(said, tls_refusal("127.0.0.1", port, agent, 60.0)), said
    with socket.create_server(("127.0.0.1", 0)) as frozen:
        port = frozen.getsockname()[1]
        assert tls_refusal("127.0.0.1", port, shown(lab), 0.05) == ""
    assert tls_refusal("127.0.0.1", port, shown(lab), 60.0) == ""
