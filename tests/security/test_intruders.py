"""Intruders and newcomers at a run with certificates: real processes around the toy plant, on the loopback."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path

import pytest
from msgspec.structs import replace

from gridpeers.wire.messages import Command, Measurement, Message, State
from gridpeers.wire.trust.key_folder import open_credentials
from gridpeers.wire.trust.site_authority import issue, make_site
from tests.processes.terminals import wait_for
from tests.security.intruder import Intruder, credentials, handshake
from tests.toy.town import Town

pytest.importorskip("cryptography", reason="certificates need the extra keys")

LIE = 12345.0  # Set-point (W) that no honest agent of the toy has


def state_of(town: Town, name: str, seq: int = 0, sender: str = "") -> State:
    seen = town.t
    town.until(lambda: town.t > seen, "a newer time of the run")
    status = town.status[name]
    return State(sender=sender or name, epoch=status.epoch, seq=seq, t=town.t, P_set=LIE, V_set=277.0, Q=0.0, island="")


def test_members_of_a_site_take_part_in_its_run(town: Town) -> None:
    """With certificates the agents find each other over TLS, and use each other's values."""
    assert town.plant_config.listen[0].startswith("tls/")
    assert {*town.status["inv1"].used} == {"inv2"}
    assert {town.session.vouches(name) for name in ("plant", "inv1", "inv2")} == {True}
    assert not town.session.vouches("inv3")


def test_without_a_certificate_nobody_gets_a_link(town: Town) -> None:
    """TLS refuses at once."""
    assert "CERTIFICATE_REQUIRED" in handshake(town.endpoint, None)
    wait_for(town.folder / "plant.log", "peer sent no certificates")


def test_with_a_certificate_of_another_site_nobody_gets_a_link(town: Town, tmp_path: Path) -> None:
    """The other site has members of the same names."""
    other = tmp_path / "lab"
    make_site(other)
    issue(other, "inv3")

    assert handshake(town.endpoint, other / "inv3.pem", other / "inv3.key") in (
        "TLSV1_ALERT_UNKNOWN_CA", "TLSV1_ALERT_DECRYPT_ERROR", "SSLV3_ALERT_BAD_CERTIFICATE",
    )  # fmt: skip
    wait_for(town.folder / "plant.log", "invalid peer certificate: ")


def test_with_an_expired_certificate_nobody_gets_a_link(town: Town, lab: Path, tmp_path: Path) -> None:
    """The certificate is of this site and ended a day ago."""
    site = tmp_path / "lab"
    shutil.copytree(lab, site)
    issue(site, "inv3", days=1.0, now=datetime.now(UTC) - timedelta(days=2))  # noqa: TID251

    assert handshake(town.endpoint, site / "inv3.pem", site / "inv3.key") == "SSLV3_ALERT_CERTIFICATE_EXPIRED"
    wait_for(town.folder / "plant.log", "certificate expired")
    assert handshake(town.endpoint, lab / "inv3.pem", lab / "inv3.key") == ""


def many(state: State) -> list[State]:
    return [replace(state, seq=state.seq + k) for k in range(60)]


def attack(town: Town, intruder: Intruder, key: str, *lies: Message) -> None:
    """Publish lies, then ask the plant for its status: its answer proves that it has had the lies' bytes before.

    Everything on a link keeps its order. When it is said first, publishers and links are new, so it is said twice.
    """
    answer = town.keys.answer(intruder.session.id)
    intruder.session.subscribe(answer)
    question = Command(sender="intruder", epoch=1, seq=7, t=0.0, verb="status", reply_to=intruder.session.id)
    for _ in range(2):
        intruder.until(answer, lambda: intruder.says(*((key, lie) for lie in lies), (town.keys.request, question)))
    seen = town.t
    town.until(lambda: town.t >= seen + 0.3, "rows after the attack")


def lies_in(town: Town) -> list[tuple[float, ...]]:
    return [row for row in town.rows if LIE in row]


def test_an_agent_cannot_speak_as_another(town: Town, lab: Path) -> None:
    """inv3 sends a state of inv1, with inv1's epoch and its next numbers. It reaches nobody."""
    with Intruder(town.endpoint, credentials(lab, "inv3")) as intruder:
        attack(town, intruder, town.keys.state("inv1"), *many(state_of(town, "inv1", 10**6)))

    assert lies_in(town) == []
    assert town.states["inv1"].P_set != LIE


def test_without_certificates_an_agent_can_speak_as_another(tmp_path: Path) -> None:
    """The same attack succeeds on open links, so the certificates stop it."""
    with Town(2, tmp_path).all() as open_town, Intruder(open_town.endpoint, None) as intruder:
        attack(open_town, intruder, open_town.keys.state("inv1"), *many(state_of(open_town, "inv1", 10**6)))

        assert lies_in(open_town)


def test_a_viewer_cannot_command(town: Town, lab: Path) -> None:
    """Its command to stop an agent does not arrive, its question about the run does; an operator's command does."""
    stop = Command(sender="visitor", epoch=0, seq=1, t=0.0, verb="stop", argument="inv1", reply_to="z1")
    with Intruder(town.endpoint, credentials(lab, "viewer")) as intruder:
        attack(town, intruder, town.keys.command, stop)
        attack(town, intruder, town.keys.request, stop)
    assert town.keys.alive_agent("inv1", "").rstrip("/") in "".join(town.tokens)
    assert not [event for event in town.events if event.subject == "inv1" and "left" in event.text]


def asks(intruder: Intruder, question: str, key: str, lies: Sequence[Message]) -> None:
    intruder.says(*((key, lie) for lie in lies))
    intruder.session.fetch(question)


def test_an_agent_cannot_publish_a_measurement(town: Town, lab: Path) -> None:
    """A measurement for inv2 from the session of inv3 does not arrive, whatever sender it names."""
    assert town.telemetry is not None
    lies = [
        Measurement(
            sender="plant", epoch=town.telemetry.epoch, seq=10**6 + k, t=town.t + 0.1, to="inv2", P=0.0, Q=LIE, V=277.0,
            f=60.0, P_set=LIE, V_set=277.0, grid_connected=False, island="inv1", roster=("inv1", "inv2"),
        )
        for k in range(60)
    ]  # fmt: skip
    key = town.keys.measurement("inv2")
    with Intruder(town.endpoint, credentials(lab, "inv3")) as intruder:
        for token in [token for token in town.tokens if "/alive/agent/inv2/" in token]:
            nameplate = town.keys.nameplate("inv2", token.rpartition("/")[2])
            intruder.linked(4).until(nameplate, partial(asks, intruder, nameplate, key, lies))
    seen = town.states["inv2"].seq
    town.until(lambda: town.states["inv2"].seq >= seen + 20, "further states of inv2")

    assert town.states["inv2"].Q != LIE
    assert lies_in(town) == []


def test_right_certificate_and_key_but_anothers_name_in_the_message(town: Town, lab: Path) -> None:
    """The plant counts it as foreign, and says so once."""
    lies = many(state_of(town, "inv1", 10**6))
    with Intruder(town.endpoint, credentials(lab, "inv3")) as intruder:
        attack(town, intruder, town.keys.leave("inv3"), *lies)

    assert lies_in(town) == []
    assert f"dropped a message on {town.keys.leave('inv3')}: foreign" in town.log("plant")


def test_a_revoked_member_gets_a_link_and_nothing_on_it(town: Town, lab: Path) -> None:
    """Zenoh knows no revocation: TLS lets eve in. She hears nothing and commands nothing; the plant says so."""
    stop = Command(sender="visitor", epoch=0, seq=1, t=0.0, verb="stop", argument="inv1", reply_to="observer")
    before = len(town.answers)
    with Intruder(town.endpoint, credentials(lab.parent / "before", "eve")) as eve:
        eve.session.watch(town.keys.any_alive)
        eve.linked(1).says((town.keys.command, stop))
        seen = town.t
        town.until(lambda: town.t >= seen + 1.0, "a second of the run")
        assert eve.session.take(1, 0.0) == []

    assert len(town.answers) == before
    town.until(lambda: "operator:eve, whose certificate was revoked" in town.log("plant"), "the plant's line")


def test_an_agent_whose_certificate_is_issued_later_joins_the_run(tmp_path: Path) -> None:
    """The others started with an older list. They use its values, and it uses theirs."""
    lab = tmp_path / "lab"
    make_site(lab)
    for name in ("inv1", "inv2"):
        issue(lab, name)
    with Town(3, tmp_path, keys_folder=lab, spares=("inv3",)).all() as town:
        host = tmp_path / "host"
        host.mkdir()
        issue(lab, "inv3")
        for file in ("ca.pem", "members.json", "inv3.pem", "inv3.key"):
            shutil.copy2(lab / file, host)
        credentials, _ = open_credentials(host, ("agent",), "inv3")

        town.add("inv3", ["-m", "gridpeers.agents"], replace(town.agent_configs["inv3"], credentials=credentials))

        town.together(("inv1", "inv2", "inv3"))
        assert town.session.vouches("inv3")
