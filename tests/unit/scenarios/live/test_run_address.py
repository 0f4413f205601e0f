"""Run names and endpoints of the commands for live runs."""

import socket
from pathlib import Path

import pytest

from gridpeers.scenarios.live.run_address import (
    Access,
    RunAddress,
    UsageError,
    accepting,
    address_of,
    check_endpoint,
    is_loopback,
    is_loopback_host,
    loopback_of,
    next_port,
    return_path,
    with_protocol,
)


def test_without_options_there_is_one_run_on_this_machine() -> None:
    """No option is needed for one plant on a laptop."""
    here = address_of("gridpeers", None)

    assert (here.run, here.connect) == ("gridpeers", ("tcp/127.0.0.1:7447",))


@pytest.mark.parametrize("run", ["a/b", "", "a*", "$", "run 1", "x" * 65, "@run", "é"])
def test_a_run_name_that_zenoh_does_not_allow_is_refused(run: str) -> None:
    """The line names the option, the name and what is allowed."""
    with pytest.raises(UsageError, match=r"--run: .* cannot be part of a Zenoh key; use 1 to 64 letters"):
        address_of(run, None)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("192.168.1.10", "write PROTOCOL/HOST:PORT, e.g. tcp/192.168.1.10:7447"),
        ("lab:7450", "e.g. tcp/lab:7450"),
        ("", "e.g. tcp/127.0.0.1:7447"),
        ("http/lab:7447", 'no protocol "http"; protocols are tcp, tls, quic, udp'),
        ("tcp/lab:0", "a port is a number from 1 to 65535, got 0"),
        ("tcp/lab:70000", "a port is a number from 1 to 65535, got 70000"),
        ("tcp/a b:7447", "is no endpoint"),
    ],
)
def test_what_is_no_endpoint_is_told_with_what_would_be(text: str, said: str) -> None:
    """The problem, the value, and the form that is right."""
    with pytest.raises(UsageError) as told:
        address_of("lab", [text])

    assert str(told.value).startswith("--connect: ")
    assert said in str(told.value)


@pytest.mark.parametrize(
    "text", ["tcp/127.0.0.1:7447", "tcp/[::1]:7447", "tls/lab.example:1", "tcp/lab:7447#iface=eth0"]
)
def test_endpoints_of_zenoh_are_taken_as_they_are(text: str) -> None:
    """Names, both kinds of addresses, and Zenoh's own suffixes."""
    assert check_endpoint("--connect", text) == text


def test_who_accepts_connections_is_known_though_it_says_nothing() -> None:
    """As of a frozen process; a port that is only taken is none, nor is one of a protocol without connections."""
    with socket.socket() as mute, socket.socket() as taken:
        mute.bind(("127.0.0.1", 0))
        mute.listen()
        taken.bind(("127.0.0.1", 0))
        listening, deaf = (f"127.0.0.1:{end.getsockname()[1]}" for end in (mute, taken))

        found = accepting((f"tcp/{deaf}", f"udp/{listening}", f"tcp/{listening}"))

    assert found == (f"tcp/{listening}",)


@pytest.mark.parametrize(
    ("connect", "listen"),
    [
        (("tcp/127.0.0.1:7447",), "tcp/127.0.0.1:0"),
        (("tcp/localhost:7447", "tcp/[::1]:7447"), "tcp/127.0.0.1:0"),
        (("tcp/127.0.0.1:7447", "tcp/10.0.0.1:7447"), "tcp/0.0.0.0:0"),
        (("tcp/[fd00::1]:7447",), "tcp/[::]:0"),
    ],
)
def test_who_connects_to_another_host_can_be_reached_from_there(connect: tuple[str, ...], listen: str) -> None:
    """On the loopback as long as everything is on it, on every address otherwise."""
    assert return_path(connect) == (listen,)


@pytest.mark.parametrize(
    ("endpoint", "words"),
    [
        ("tls/127.0.0.1:7447", ["--keys", "lab"]),
        ("tls/0.0.0.0:7500", ["--connect", "tls/127.0.0.1:7500", "--keys", "lab"]),
    ],
)
def test_the_options_that_find_a_run_say_what_is_not_the_default(endpoint: str, words: list[str]) -> None:
    """`up` names its commands with them; with certificates the default endpoint is tls."""
    address = RunAddress(run="gridpeers", connect=(endpoint,), access=Access(keys=Path("lab")))

    assert address.words == words


def test_only_an_address_of_the_loopback_counts_as_one() -> None:
    """Anybody may register a name that begins like an address."""
    hosts = ("127.0.0.1", "[::1]", "localhost", "0.0.0.0", "127.lab.example")

    assert [is_loopback_host(host) for host in hosts] == [True, True, True, False, False]
    assert not is_loopback(("tcp/127.0.0.1:7447", "tcp/192.168.1.10:7447"))


def test_endpoints_as_other_commands_need_them() -> None:
    """On the same host, at the next port, and with certificates."""
    listens = ("tcp/0.0.0.0:7447", "tcp/[::]:7447", "tcp/10.0.0.1:7447")

    assert [*map(loopback_of, listens)] == ["tcp/127.0.0.1:7447", "tcp/[::1]:7447", "tcp/10.0.0.1:7447"]
    assert [*map(next_port, ("tcp/127.0.0.1:7447", "tcp/[::1]:65535"))] == ["tcp/127.0.0.1:7448", "tcp/[::1]:65534"]
    assert with_protocol("tcp/lab:7447", keys=True, default="tcp/lab:7447") == "tls/lab:7447"
    assert RunAddress(run="gridpeers", connect=("tcp/127.0.0.1:7447",)).words == []
    assert RunAddress(run="demo", connect=("tcp/0.0.0.0:7500",)).words == [
        "--run",
        "demo",
        "--connect",
        "tcp/127.0.0.1:7500",
    ]
