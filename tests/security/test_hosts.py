"""Intruders on a host of their own, an agent on another and the plant on a third: network namespaces."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.processes.hosts import Hosts, NoHostsError
from tests.processes.terminals import Desk, Terminal

pytest.importorskip("cryptography", reason="certificates need the extra keys")

CALM = '[time]\nend_s = 10.0\n[case.IV]\nsecondary = "all"\ngraph = "full"\n'
ROOT = Path(__file__).parents[2]


class Site(NamedTuple):
    """A run on three hosts, and the keys that intruders have."""

    hosts: Hosts
    desk: Desk
    plant: Terminal
    folder: Path

    @property
    def endpoint(self) -> str:
        """Where the plant listens."""
        return f"tls/{self.hosts.address(1)}:7447"

    def attack(self, keys: str, name: str, attack: str, longest: float) -> subprocess.Popen[str]:
        """Start an attack from the third host, where each answer is awaited for so long (s)."""
        folder = "-" if keys == "-" else str(self.folder / keys)
        words = ["-m", "tests.security.intrude", self.endpoint, "sites", folder, name, attack, f"{longest:g}"]
        return subprocess.Popen(
            [*self.hosts.at(3), sys.executable, *words],
            cwd=ROOT, env=os.environ | {"PYTHONPATH": str(ROOT)}, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """The plant on host 1, inv1 on host 2, with certificates; intruders have keys of every kind."""
    from gridpeers.wire.trust.site_authority import issue, make_site, revoke

    folder = tmp_path_factory.mktemp("hosts")
    (folder / "calm.toml").write_text(CALM)
    make_site(folder / "lab")
    make_site(folder / "other")
    issue(folder / "other", "inv3")
    for name in ("inv1", "inv3"):
        issue(folder / "lab", name)
    issue(folder / "lab", "eve", "operator")
    shutil.copytree(folder / "lab", folder / "before")
    revoke(folder / "lab", "eve")
    with Desk(folder, "--run", "sites", "--keys", "lab") as desk:
        try:
            with Hosts(3) as hosts:
                listen = f"tls/{hosts.address(1)}:7447"
                plant = desk.open("plant", "calm.toml", "--listen", listen, "--wait", "0", prefix=hosts.at(1))
                agent = desk.open("agent", "inv1", "--connect", listen, prefix=hosts.at(2))
                agent.expect("joins at t = ")
                yield Site(hosts, desk, plant, folder)
                down = desk.open("down", "--connect", listen, prefix=hosts.at(2))
                assert (down.end(), plant.end(), agent.end()) == (0, 0, 0), down.text + plant.text + agent.text
        except NoHostsError as error:
            pytest.skip(f"network namespaces cannot be made here: {error}")


ATTACKS = {
    ("-", "", "command"): "no access",
    ("other", "inv3", "state"): "no access",
    ("before", "eve", "command"): "no access",
    ("lab", "inv3", "state"): "kept out",
    ("lab", "inv3", "measurement"): "kept out",
    ("lab", "inv3", "command"): "kept out",
    ("lab", "viewer", "command"): "kept out",
}
"""Outcome of each attack, by keys, name and what is sent."""


def test_intruders_on_another_host_are_kept_out(site: Site) -> None:
    """Nobody without a valid certificate has access, and those who have one can do what is theirs alone."""
    longest = {"no access": 8.0, "kept out": 60.0}  # who has access is answered, however busy the machine is
    attacks = {attack: site.attack(*attack, longest[outcome]) for attack, outcome in ATTACKS.items()}
    told = {attack: process.communicate(timeout=100)[0] for attack, process in attacks.items()}

    assert {attack: text.strip().rpartition("\n")[2] for attack, text in told.items()} == ATTACKS
    status = site.desk.open("status", "--connect", site.endpoint, prefix=site.hosts.at(1))
    assert status.end() == 0, status.text
    (row,) = [line.split() for line in status.lines if line.startswith("inv1 ")]
    assert "12.3" not in row


def test_an_expired_certificate_is_refused_by_both_sides(site: Site) -> None:
    """Our command does not start with it; TLS of the other host refuses it, and the plant says so."""
    from gridpeers.wire.trust.site_authority import issue

    late = site.folder / "late"
    shutil.copytree(site.folder / "lab", late)
    issue(late, "inv3", days=1.0, now=datetime.now(UTC) - timedelta(days=2))
    agent = site.desk.open_bare("agent", "inv3", "--keys", "late", "--connect", site.endpoint, prefix=site.hosts.at(3))
    assert agent.end() == 2
    assert "late/inv3.pem: expired on " in agent.text

    words = "from tests.security.intruder import handshake; from pathlib import Path; import sys;"
    words += "print(handshake(sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])))"
    done = subprocess.run(
        [*site.hosts.at(3), sys.executable, "-c", words, site.endpoint, str(late / "inv3.pem"), str(late / "inv3.key")],
        cwd=ROOT, env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert done.stdout.strip() == "SSLV3_ALERT_CERTIFICATE_EXPIRED", done.stderr
    site.plant.expect("certificate expired")
