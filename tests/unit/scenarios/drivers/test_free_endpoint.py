"""Endpoints to listen on: free ones, and the errors of others."""

import shutil
import socket
import subprocess
import sys

import pytest

from gridpeers.scenarios.drivers.free_endpoint import ListenError, free_endpoint


def test_a_port_in_use_is_told_before_anything_starts() -> None:
    """The endpoint, the reason and the two ways out."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        text = f"tcp/127.0.0.1:{taken.getsockname()[1]}"

        with pytest.raises(
            ListenError,
            match=f"--listen: {text} cannot be listened on: address already in use; end what.* kill -CONT",
        ):
            free_endpoint(text, option="--listen")


def test_port_0_becomes_a_free_port() -> None:
    """The endpoint to be told to others has a number."""
    assert int(free_endpoint("tcp/127.0.0.1:0").rpartition(":")[2]) > 0


def test_an_address_of_another_machine_cannot_be_listened_on() -> None:
    """192.0.2.0/24 belongs to nobody: there is nothing to end there, and the line does not say so."""
    with pytest.raises(
        ListenError, match=r"cannot be listened on: .*; 192\.0\.2\.1 is no address of this host"
    ) as told:
        free_endpoint("tcp/192.0.2.1:7447")

    assert "end what" not in str(told.value)


def test_a_name_without_an_address_cannot_be_listened_on() -> None:
    """The names under .invalid never have one."""
    with pytest.raises(ListenError, match=r"cannot be listened on: .*; no address is known of lab\.invalid"):
        free_endpoint("tcp/lab.invalid:7447")


def _apart(code: str) -> str:
    """Return what code prints in a network namespace of its own, where the loopback interface is down."""
    if shutil.which("unshare") is None or subprocess.run(["unshare", "-n", "true"], capture_output=True).returncode:
        pytest.skip("network namespaces cannot be made here")
    done = subprocess.run(["unshare", "-n", sys.executable, "-c", code], capture_output=True, text=True, check=False)
    return done.stdout + done.stderr


@pytest.mark.parametrize("text", ["tcp/127.0.0.1:0", "tcp/0.0.0.0:7447"])
def test_a_host_whose_loopback_is_down_is_told_before_anything_starts(text: str) -> None:
    """An address can be bound there, and nobody reaches it: a run would wait for its agents and never begin."""
    told = _apart(
        f"from gridpeers.scenarios.drivers.free_endpoint import free_endpoint; "
        f"free_endpoint({text!r}, option='--listen')"
    )

    assert f"ListenError: --listen: {text} is of no use: processes of this host cannot connect to each other" in told
    assert "bring it up: ip link set lo up" in told


def test_a_plant_is_not_waited_for_where_nothing_can_be_reached() -> None:
    """The search for one on the loopback ends at its first look, with the same advice."""
    told = _apart(
        "from gridpeers.scenarios.live.run_address import address_of\n"
        "from gridpeers.scenarios.live.run_client import RunClient\n"
        "with RunClient(address_of('lab', None)) as client: client.find_plant(60.0)"
    )

    assert "NobodyError: nothing can be reached at tcp/127.0.0.1:7447: processes of this host cannot connect" in told
