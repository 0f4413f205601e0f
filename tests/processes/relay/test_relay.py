from __future__ import annotations

import contextlib
import errno
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing

import pytest

from netem.draws import Stream
from netem.relay import EndpointError, Faults, FaultsError, Relay, RelayCommandError, RelayError

PATIENCE = 60.0
"""Longest wait (s) of a socket; on an idle machine none waits long."""


def address(endpoint: str) -> tuple[str, int]:
    """Host and port."""
    host, _, port = endpoint.partition("/")[2].rpartition(":")
    return host, int(port)


def dial(relay: Relay) -> socket.socket:
    """A connection to a relay."""
    return socket.create_connection(address(relay.endpoint), timeout=PATIENCE)


def read(sock: socket.socket, count: int) -> bytes:
    """So many bytes."""
    got = b""
    while len(got) < count and (piece := sock.recv(count - len(got))):
        got += piece
    return got


@pytest.fixture
def server() -> Iterator[socket.socket]:
    """A target that listens for connections."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        listening.settimeout(PATIENCE)
        yield listening


@pytest.fixture
def target() -> Iterator[socket.socket]:
    """A target of datagrams."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as bound:
        bound.bind(("127.0.0.1", 0))
        bound.settimeout(PATIENCE)
        yield bound


def endpoint_of(sock: socket.socket) -> str:
    """Endpoint of a target."""
    kind = "tcp" if sock.type == socket.SOCK_STREAM else "udp"
    return f"{kind}/127.0.0.1:{sock.getsockname()[1]}"


def test_a_stream_is_the_same_behind_every_fault(server: socket.socket) -> None:
    """Much each way through jitter, loss, a small queue and a change on the way: the same bytes, then the end."""
    there, back = os.urandom(200_000), os.urandom(150_000)
    faults = Faults(delay=0.01, jitter=0.01, loss=0.01, rate=5e6, queue=1500)
    with Relay("tcp/127.0.0.1:0", endpoint_of(server), there=faults, back=faults, seed=3) as relay:
        with dial(relay) as near, closing(server.accept()[0]) as far, ThreadPoolExecutor(2) as senders:
            far.settimeout(PATIENCE)
            senders.submit(_send_all, near, there)
            senders.submit(_send_all, far, back)
            assert read(far, 1000) == there[:1000]
            relay.do("rate 0 loss 0.02")
            assert read(far, len(there)) == there[1000:], "and then the end"
            assert read(near, len(back) + 1) == back, "and then the end"
        counts = relay.counts()

    assert all(one.lost > 0 and one.came == one.forwarded + one.cut > 0 for one in counts)


def _send_all(sock: socket.socket, data: bytes) -> None:
    sock.sendall(data)
    sock.shutdown(socket.SHUT_WR)


def test_a_reset_is_one_for_both_ends_and_new_connections_are_welcome(server: socket.socket) -> None:
    """Both ends of a connection get RST, not a proper end; the next connection works."""
    with Relay("tcp/127.0.0.1:0", endpoint_of(server)) as relay:
        with dial(relay) as near, closing(server.accept()[0]) as far:
            far.settimeout(PATIENCE)
            near.sendall(b"1")
            assert read(far, 1) == b"1"

            assert relay.do("reset") == "1 connection reset"

            for end in (near, far):
                with pytest.raises(ConnectionResetError):
                    end.recv(1)
        with dial(relay) as near, closing(server.accept()[0]) as far:
            far.settimeout(PATIENCE)
            near.sendall(b"2")
            assert read(far, 1) == b"2"


def test_who_comes_while_the_relay_is_cut_is_refused(server: socket.socket) -> None:
    """Cut, twice even: connections are reset and refused at the same port; healed, they are accepted there again."""
    with Relay("tcp/127.0.0.1:0", endpoint_of(server)) as relay:
        with dial(relay) as near, closing(server.accept()[0]):
            assert relay.do("cut") == "cut until heal"
            with pytest.raises(ConnectionResetError):
                near.recv(1)
        relay.do("cut")
        with pytest.raises(ConnectionRefusedError):
            dial(relay)
        assert ": 0 connections, cut; there: no fault; " in relay.do("show")

        assert relay.do("heal") == "healed"

        with dial(relay) as near, closing(server.accept()[0]) as far:
            far.sendall(b"3")
            assert read(near, 1) == b"3"


def test_a_target_that_is_not_there_resets_the_connection() -> None:
    """A connection made while the target is down ends, and may be tried again."""
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        relayed = Relay("tcp/127.0.0.1:0", endpoint_of(silent))
        # the reset may come as early as in connect()
        with relayed as relay, pytest.raises(ConnectionResetError), dial(relay) as near:
            near.recv(1)


def test_a_stall_keeps_what_comes_until_it_is_healed(server: socket.socket, target: socket.socket) -> None:
    """While stalled nothing passes, though the connection stays; healed, all of it comes, of datagrams too."""
    relayed = Relay("tcp/127.0.0.1:0", endpoint_of(server))
    with relayed as relay, dial(relay) as near, closing(server.accept()[0]) as far:
        relay.do("stall")
        near.sendall(b"held")
        wait_for(relay, "1 came, 0 forwarded")
        far.setblocking(False)
        with pytest.raises(BlockingIOError):
            far.recv(1)
        relay.do("heal")
        far.settimeout(PATIENCE)
        assert read(far, 4) == b"held"
    with Relay("udp/127.0.0.1:0", endpoint_of(target)) as relay, talker(relay) as near:
        relay.do("stall")
        near.send(b"held")
        wait_for(relay, "1 came, 0 forwarded")
        relay.do("stall 0")
        assert target.recv(9) == b"held"


def test_datagrams_go_both_ways_and_die_in_a_cut(target: socket.socket) -> None:
    """Answers find who asked, each of two; in a cut nothing passes; a reset forgets both, and the next is new."""
    with Relay("udp/127.0.0.1:0", endpoint_of(target)) as relay, talker(relay) as one, talker(relay) as two:
        for asker, word in ((one, b"1"), (two, b"2")):
            asker.send(word)
            got, source = target.recvfrom(9)
            assert got == word
            target.sendto(b"re:" + word, source)
            assert asker.recv(9) == b"re:" + word
        relay.do("cut")
        two.send(b"gone")
        wait_for(relay, "1 cut")
        relay.do("heal")
        assert relay.do("reset") == "2 conversations reset"
        two.send(b"here")
        assert target.recv(9) == b"here"
        assert ": 1 conversation; " in relay.do("show")


def test_a_repeated_run_loses_the_same_datagrams(target: socket.socket) -> None:
    """The same seed, the same datagrams lost, as a draw by number says; all of them counted."""
    arrived = []
    for _ in range(2):
        with Relay("udp/127.0.0.1:0", endpoint_of(target), there=Faults(loss=0.3), seed=5) as relay:
            with talker(relay) as near:
                for number in range(200):
                    near.send(bytes([number]))
                    wait_for(relay, f"{number + 1} came")
                there = relay.counts()[0]
            arrived.append([target.recv(1)[0] for _ in range(there.forwarded)])
            assert there.lost == 200 - there.forwarded

    losses = Stream(5, "1", "there", "loss")
    assert arrived[0] == arrived[1] == [n for n in range(200) if losses.uniform(n + 1) >= 0.3]


def talker(relay: Relay) -> socket.socket:
    """A socket that sends datagrams to a relay."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.settimeout(PATIENCE)
    sock.connect(address(relay.endpoint))
    return sock


def wait_for(relay: Relay, what: str) -> None:
    """Ask the relay what it counted until it says so; pytest's time limit ends it otherwise."""
    while what not in relay.do("show"):
        pass


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("", "begins with one of delay, jitter"),
        ("delay", "begins with one of delay"),
        ("delay 0.1 0.2", "begins with one of delay"),
        ("slow 3", "begins with one of delay"),
        ("stall -1", "a duration is positive, got -1 s"),
        ("loss much", '"much" is no number'),
    ],
)
def test_a_line_that_is_not_understood_is_explained(line: str, complaint: str) -> None:
    """The error of a line that is no command lists the commands, or says what is wrong with the number."""
    with Relay("udp/127.0.0.1:0", "udp/127.0.0.1:1") as relay, pytest.raises(RelayCommandError, match=complaint):
        relay.do(line)


def test_one_direction_can_be_changed_alone_and_a_bad_change_changes_nothing(target: socket.socket) -> None:
    """`back` means back; a refused line leaves all as it was, the good half of it too."""
    with Relay("udp/127.0.0.1:0", endpoint_of(target)) as relay:
        assert relay.do("delay 0.2 jitter 0.05 back") == "back: delay 0.2 s, jitter 0.05 s"
        with pytest.raises(FaultsError, match=r"there/back: jitter: 0.05 s is more than the delay of 0 s"):
            relay.do("loss 0.5 jitter 0.05")
        shown = relay.do("show")

    assert "there: no fault; 0 came" in shown
    assert "back: delay 0.2 s, jitter 0.05 s; 0 came" in shown


def test_a_relay_that_cannot_be_is_explained(server: socket.socket, target: socket.socket) -> None:
    """A port in use, two transports, a stream out of order, an unknown transport: each says so."""
    with pytest.raises(RelayError, match=r"cannot listen on tcp/.*: address already in use; choose another port"):
        Relay(endpoint_of(server), "tcp/127.0.0.1:1")
    with pytest.raises(RelayError, match="does not turn tcp into another transport"):
        Relay("tcp/127.0.0.1:0", endpoint_of(target))
    with pytest.raises(EndpointError, match='knows tcp and udp, not "tls"'):
        Relay("tls/127.0.0.1:0", "tls/127.0.0.1:1")
    with pytest.raises(FaultsError, match="TCP connection keeps its order"):
        Relay("tcp/127.0.0.1:0", "tcp/127.0.0.1:1", there=Faults(delay=0.1, reorder=0.1))


def test_the_command_answers_every_line_with_one_and_ends_when_told(server: socket.socket) -> None:
    """By hand: what it relays, what was changed, what was refused, what came of it; SIGTERM ends it as "end" does."""
    command = [sys.executable, "-m", "netem.relay", "tcp/127.0.0.1:0", endpoint_of(server), "--delay", "0.01"]
    lines = "delay 0.2 there\nloss 30\nfaster\nstall 3\nheal\nshow\nend\n"

    done = subprocess.run([*command, "--back-delay", "0"], input=lines, capture_output=True, text=True, timeout=60)

    said = done.stdout.splitlines()
    assert (done.returncode, done.stderr) == (0, "")
    assert "there: delay 0.01 s; " in said[0]
    assert "back: no fault; " in said[0]
    assert said[1] == "there: delay 0.2 s"
    assert said[2].startswith("refused: there/back: loss: a loss is a probability from 0 to 1, got 30; did you mean")
    assert said[3].startswith('refused: "faster" is not understood')
    assert said[4:6] == ["stalled for 3 s", "healed"]
    assert "there: delay 0.2 s; 0 came" in said[6]
    assert said[7:] == ["ending"]
    with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True) as background:
        assert background.stdout is not None
        assert background.stdout.readline().startswith("tcp/127.0.0.1:")
        background.send_signal(signal.SIGTERM)
        assert background.wait(PATIENCE) == 0
    bad = subprocess.run([*command, "--loss", "3"], capture_output=True, text=True, timeout=60)
    assert bad.returncode == 2
    assert "did you mean 0.03 (3 %)?" in bad.stderr


def test_connections_that_come_and_go_through_faults_all_end_and_are_accounted_for(server: socket.socket) -> None:
    """While the relay stalls, resets, is cut and heals: whole echoes or a reset, and no connection is left."""

    def echo(number: int) -> None:
        with contextlib.suppress(OSError), closing(server.accept()[0]) as far:
            far.settimeout(PATIENCE)
            while data := far.recv(65536):
                far.sendall(data)

    def call(number: int) -> bool:
        sent = bytes([number]) * 20_000
        with contextlib.suppress(ConnectionError), dial(relay) as near:
            near.sendall(sent)
            try:
                near.shutdown(socket.SHUT_WR)
            except OSError as error:
                if error.errno == errno.ENOTCONN:  # the reset came before
                    return False
                raise
            got = read(near, len(sent) + 1)
            assert got == sent, "an end without a reset comes after all bytes"
            return True
        return False

    faults = Faults(delay=0.002, loss=0.02, rate=1e7)
    with (
        Relay("tcp/127.0.0.1:0", endpoint_of(server), there=faults, back=faults) as relay,
        ThreadPoolExecutor(6) as servers,
        ThreadPoolExecutor(6) as clients,
        contextlib.ExitStack() as ending,
    ):
        ending.callback(server.shutdown, socket.SHUT_RDWR)  # ends the echoes that wait
        servers.map(echo, range(200))
        calls = clients.map(call, range(100))
        for line in ("stall 0.05", "reset", "cut", "heal", "delay 0.005", "reset"):
            relay.do(line)
        assert len(list(calls)) == 100  # a whole echo or a reset each; all may have met the cut
        assert call(1)
        wait_for(relay, ": 0 connections")
        for counts in relay.counts():
            assert counts.came == counts.forwarded + counts.cut
