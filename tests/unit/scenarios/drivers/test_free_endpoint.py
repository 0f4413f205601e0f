"""Endpoints to listen on: free ones, and the errors of others."""

import socket

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
