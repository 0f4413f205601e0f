from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from tests.command_line import invoke

pytest.importorskip("cryptography", reason="certificates need the extra keys")

MTLS = 'security = "mtls"\n[time]\nend_s = 0.1\n[case.calm]\nsecondary = "all"\ngraph = "ring"\n'


def refused(*words: str) -> str:
    """Return the lines with which a command that ends with exit code 2 refuses its options."""
    code, text = invoke(*words)
    assert code == 2, text
    assert "Traceback" not in text
    return text


def test_a_site_from_its_making_to_a_revoked_member(elsewhere: Path) -> None:
    """init, issue, show and revoke say what they did and when certificates end."""
    code, made = invoke("keys", "init", "lab")
    assert code == 0, made
    assert (
        "lab: the site lab, with certificates of plant (plant), operator (operator), viewer (viewer), until 2" in made
    )
    assert "Keep lab/ca.key here: it signs certificates of any name" in made

    code, issued = invoke("keys", "issue", "inv1", "inv2", "--keys", "lab")
    assert code == 0, issued
    assert "lab/inv1.pem: certificate of inv1, role agent, until 2" in issued

    code, revoked = invoke("keys", "revoke", "inv2", "--keys", "lab")
    assert code == 0, revoked
    assert "inv2: revoked. Copy lab/members.json to every host, and restart all processes" in revoked

    code, shown = invoke("keys", "show", "--keys", "lab")
    assert code == 0, shown
    rows = shown.splitlines()
    assert rows[0] == "site lab, members.json is version 6; ca.key is here: certificates are issued in this folder"
    assert [row.split()[:3] for row in rows[1:3]] == [["agent", "inv1", "valid"], ["agent", "inv2", "revoked"]]
    assert rows[1].endswith(", key here")

    renewed = invoke("keys", "issue", "plant", "inv2", "--keys", "lab")[1]  # a name keeps its role
    assert [line.split(", ")[1] for line in renewed.splitlines()] == ["role plant", "role agent"]


def test_what_cannot_be_done_with_a_site_is_refused(elsewhere: Path) -> None:
    """A folder that is there, one that is none, a life of no days."""
    assert invoke("keys", "init", "lab")[0] == 0
    assert "lab: already exists; gridpeers keys show --keys lab shows it" in refused("keys", "init", "lab")
    assert "other: does not exist; gridpeers keys init other makes a folder of keys" in refused(
        "keys", "show", "--keys", "other"
    )
    assert "ca.pem: is missing; copy it from" in refused("keys", "show")
    assert "'--days': Input should be greater than or equal to 0.01" in refused("keys", "init", "x", "--days", "0")
    assert 'no certificate was issued to "inv7"' in refused("keys", "revoke", "inv7", "--keys", "lab")


def test_show_says_to_the_minute_until_when_certificates_are_valid(elsewhere: Path) -> None:
    """One may end within hours."""
    from gridpeers.wire.trust.site_authority import issue

    assert invoke("keys", "init", "lab")[0] == 0
    now = datetime.now(UTC)  # noqa: TID251
    issue(Path("lab"), "inv1", days=1.0, now=now - timedelta(days=3))
    issue(Path("lab"), "inv2", days=0.25, now=now)
    rows = {row.split()[1]: row.split(maxsplit=2)[2] for row in invoke("keys", "show", "--keys", "lab")[1].splitlines()}

    assert rows["inv1"] == f"expired  {now - timedelta(days=2):%Y-%m-%d %H:%M} UTC, key here"
    assert rows["inv2"] == f"valid    until {now + timedelta(hours=6):%Y-%m-%d %H:%M} UTC, key here"


def test_a_viewer_is_told_who_may_command(elsewhere: Path) -> None:
    """With the files of a viewer alone, by name or not: the role that may, and how to get it."""
    assert invoke("keys", "init", "lab")[0] == 0
    (elsewhere / "lab" / "operator.key").unlink()
    said = "lab: viewer has the role viewer, which may look at a run (status, watch, view), but not command it; an "

    assert f"{said}operator may: --as operator takes the certificate of one" in refused("down", "--keys", "lab")
    assert invoke("keys", "revoke", "operator", "--keys", "lab")[0] == 0
    named = refused("down", "--keys", "lab", "--as", "viewer")
    assert f"{said}operator may: gridpeers keys issue NAME --role operator" in named


FAR, NEAR = "tcp/192.0.2.1:7447", "tcp/127.0.0.1:1"
OPEN = (
    "is not on this host's loopback, and without certificates whoever reaches it reads and commands the run; use "
    "--keys DIR and tls/192.0.2.1:7447 (docs/how-to/several-hosts.md), or --insecure on a network that you trust"
)


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["plant", "islanding", "--listen", FAR], f"--listen: {FAR} {OPEN}"),
        (["up", "islanding", "--listen", "tcp/0.0.0.0:7447"], "--listen: tcp/0.0.0.0:7447 is not on this host"),
        (["agent", "inv1", "--connect", FAR], f"--connect: {FAR} {OPEN}"),
        (["down", "--connect", "tls/127.0.0.1:1"], "--connect: tls/127.0.0.1:1 needs certificates: use --keys DIR"),
        (["status", "--connect", NEAR, "--keys", "lab"], f"--connect: {NEAR} is open, and --keys needs TLS"),
        (["status", "--as", "eve"], "--as: needs --keys DIR, the folder of the certificates"),
        (["status", "--keys", "nowhere"], "nowhere: does not exist"),
        (["agent", "inv7", "--keys", "lab"], 'no certificate was issued to "inv7"; those of role agent: none'),
        (["agent", "inv1", "inv2", "--keys", "lab"], "--keys: a process has one certificate"),
        (["run", "islanding", "--keys", "lab"], 'lab: no certificate was issued to "inv9"'),
        (["run", "islanding", "--keys", "lab", "--driver", "inprocess"], "--keys: needs --driver processes"),
        (["run", "islanding", "--keys", "lab", "--processes", "3"], "--processes: agents of one process have one"),
        (["run", "mtls.toml"], 'security = "mtls": give --keys DIR'),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_options_that_do_not_fit_are_refused_before_anything_starts(
    words: list[str], text: str, elsewhere: Path
) -> None:
    """One line each, and exit code 2."""
    (elsewhere / "mtls.toml").write_text(MTLS)
    assert invoke("keys", "init", "lab")[0] == 0

    assert text in refused(*words)
