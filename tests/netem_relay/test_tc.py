from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator

import pytest

from netem.relay import Faults
from netem.tc import Impaired, Step, TcError, netem_steps, steps_without_netem, try_out, why_no_netem


def words(steps: tuple[Step, ...]) -> list[str]:
    """The commands as one would type them."""
    return [" ".join(step.do) for step in steps]


def test_every_fault_becomes_words_of_netem() -> None:
    """Times in us, probabilities in percent, bytes per second as tc's "bps"; without a fault, no command."""
    everything = Faults(delay=0.1, jitter=0.0005, loss=0.005, reorder=0.25, rate=20e3)

    assert words(netem_steps("eth0", everything)) == [
        "tc qdisc add dev eth0 root netem limit 10000 delay 100000us 500us loss random 0.5% reorder 25% rate 20000bps"
    ]
    assert words(netem_steps("eth0", Faults(rate=1e7))) == [
        "tc qdisc add dev eth0 root netem limit 10000 rate 10000000bps"
    ]
    assert netem_steps("eth0", Faults()) == ()
    assert netem_steps("eth0", everything)[0].undo == ("tc", "qdisc", "delete", "dev", "eth0", "root")


def test_without_netem_a_delay_is_refused_with_what_to_do_instead() -> None:
    """Loss and rate have other means; who wants a delay is sent to the relay or the scenario."""
    with pytest.raises(
        TcError, match=r"eth0: .* not delay them \(delay 0.1 s\); for a delay use python -m netem.relay"
    ):
        steps_without_netem("eth0", Faults(delay=0.1))
    assert len(steps_without_netem("eth0", Faults(loss=1.0, rate=1e4))) == 3
    assert steps_without_netem("eth0", Faults()) == ()


@pytest.fixture
def namespace() -> Iterator[str]:
    """A network namespace whose loopback is up."""
    name = f"gptc{os.getpid()}"
    try:
        done = subprocess.run(["ip", "netns", "add", name], capture_output=True, text=True)
    except FileNotFoundError:
        pytest.skip("there is no command ip")
    if done.returncode != 0:
        pytest.skip(f"network namespaces cannot be made here: {done.stderr}")
    subprocess.run(["ip", "-n", name, "link", "set", "lo", "up"], check=True)
    yield name
    subprocess.run(["ip", "netns", "delete", name], check=True)


def on_device(namespace: str) -> str:
    """What tc says of the loopback."""
    command = ["ip", "netns", "exec", namespace, "tc", "qdisc", "show", "dev", "lo"]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def test_a_device_is_left_as_it_was_found(namespace: str) -> None:
    """What is set is taken off at the end and after a failure half-way; what others have set is not touched."""
    steps = steps_without_netem("lo", Faults(loss=0.02, rate=1e6))
    why = try_out(steps)
    if why:
        pytest.skip(f"this kernel loses no packets for us: {why}")
    clean = on_device(namespace)
    with Impaired("lo", steps, namespace=namespace):
        during = on_device(namespace)
        with pytest.raises(TcError, match=r"lo: .*tc qdisc add dev lo clsact: Error: Exclusivity flag on"):
            Impaired("lo", steps, namespace=namespace).__enter__()
        assert on_device(namespace) == during
    assert on_device(namespace) == clean

    with pytest.raises(TcError, match=r"lo: .*no-such-qdisc"):
        Impaired(
            "lo", (*steps, Step(("tc", "qdisc", "add", "dev", "lo", "no-such-qdisc"))), namespace=namespace
        ).__enter__()

    assert "clsact" in during
    assert "tbf" in during
    assert on_device(namespace) == clean


def test_the_command_says_whether_the_kernel_has_netem() -> None:
    """Exit status 0 where it has; else 1, with the reason and what to do instead."""
    done = subprocess.run([sys.executable, "-m", "netem.tc"], capture_output=True, text=True, timeout=60)

    if done.returncode == 0:
        assert why_no_netem() == ""
    else:
        assert re.match(r"no tc netem here: .+; tc can then still lose .+ python -m netem.relay", done.stdout)
        assert why_no_netem() != ""
