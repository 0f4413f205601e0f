"""Processes that are forked from a server which has imported their modules."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
from pathlib import Path
from time import monotonic

import pytest

from gridpeers.scenarios.drivers.children import Child
from gridpeers.scenarios.drivers.forking import (
    AVAILABLE,
    ForkServer,
    ForkServerError,
    agent_server,
    plant_server,
    release,
)
from gridpeers.wire.driver.process import BAD_CONFIG, IN_ORDER
from tests.toy.toy_configs import agent_config

pytestmark = pytest.mark.skipif(not AVAILABLE, reason="forks on Linux alone")


def stat_of(pid: int) -> list[str]:
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()


def test_a_forked_process_is_a_child_like_any_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It has this process as its parent, a session, a name in `ps`, a log, an exit status, and outlives the server."""
    speaker = "import sys\nprint('there', flush=True)\nprint(sys.stdin.read(), file=sys.stderr)\nsys.exit(7)\n"
    (tmp_path / "speaker.py").write_text(speaker)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with (tmp_path / "log").open("wb") as log:
        with ForkServer(("gridpeers.agents.__main__",)) as server:
            good, killed = (server.fork(["speaker", "--leash", name], log, speaks=True) for name in ("inv1", "inv2"))
        assert good.stdin is not None
        assert good.stdout is not None
        assert good.stdout.readline() == b"there\n"  # it has become what it is: before, it looks like its server
        parent, group, session = stat_of(good.pid)[1:4]
        command = Path(f"/proc/{good.pid}/cmdline").read_text()
        good.stdin.write(b"heard")
        good.stdin.close()
        killed.send_signal(signal.SIGKILL)

        assert (good.wait(), killed.wait()) == (7, -signal.SIGKILL)
        assert int(parent) == os.getpid()
        assert int(group) == int(session) == good.pid != killed.pid
    assert command == f"{sys.executable} -P -m speaker --leash inv1\0"
    assert (tmp_path / "log").read_text() == "heard\n"
    for pipe in (good.stdout, killed.stdout, killed.stdin):
        assert pipe is not None
        pipe.close()


def test_a_process_that_cannot_be_forked_is_started_anew(tmp_path: Path) -> None:
    """A server that is gone costs time and nothing else."""
    config = agent_config("inv1")
    with ForkServer(("no_such_module",)) as server:
        child = Child("inv1", ["-m", "gridpeers.agents"], config, tmp_path / "log", lambda child: None, server=server)
        child.signal(signal.SIGKILL)
        child.release()

    assert child.join(monotonic() + 60.0)
    assert child.status == -signal.SIGKILL


def test_a_server_with_threads_forks_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A lock that another thread holds would stay locked in the new process for ever."""
    text = "import threading, time\nthreading.Thread(target=time.sleep, args=(60,), daemon=True).start()\n"
    (tmp_path / "busy_module.py").write_text(text)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))

    with (
        (tmp_path / "log").open("wb") as log,
        ForkServer(("busy_module",)) as server,
        pytest.raises(ForkServerError, match="has 2 threads"),
    ):
        server.fork(["gridpeers.agents"], log, speaks=False)


def test_a_server_stays_until_its_surroundings_change(monkeypatch: pytest.MonkeyPatch) -> None:
    """A variable that has changed since must reach what is started now, as it reaches any new process."""
    try:
        first = agent_server()
        assert first is not None
        assert agent_server() is first
        monkeypatch.setenv("RUST_LOG", "zenoh=warn")
        second = agent_server()
        assert second is not None
        assert second is not first
        assert second.lives
        assert not first.lives
    finally:
        release()
    assert not second.lives
    assert agent_server(start=False) is None


def test_a_forked_plant_has_loaded_its_step_and_no_thread(tmp_path: Path) -> None:
    """So it can be forked at all, and is ready in a tenth of the time of a new process."""
    try:
        server = plant_server()
        assert server is not None
        with (tmp_path / "log").open("wb") as log:
            plant = server.fork(["gridpeers.plant", "--leash", "plant"], log, speaks=True)
        libraries = Path(f"/proc/{plant.pid}/maps").read_text()
        plant.stdin.close()
        assert plant.wait() == IN_ORDER + BAD_CONFIG  # no configuration
        assert plant.stdout is not None
        plant.stdout.close()
    finally:
        release()
    assert "llvmlite" in libraries


def test_servers_go_with_a_process_that_is_killed(tmp_path: Path) -> None:
    """Nobody can end them then: they leave because nobody can ask them any more."""
    code = """
from gridpeers.scenarios.drivers.forking import agent_server
with open("log", "wb") as log:
    agent_server().fork(["gridpeers.agents"], log, speaks=False)  # so the server has imported, and serves
    print(agent_server()._server.pid, flush=True)
    input()
"""
    with subprocess.Popen(
        [sys.executable, "-c", code], cwd=tmp_path, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as owner:
        assert owner.stdout is not None
        server = int(owner.stdout.readline())
        watched = os.pidfd_open(server)
        owner.kill()
    assert select.select([watched], [], [], 60.0)[0]
    os.close(watched)
