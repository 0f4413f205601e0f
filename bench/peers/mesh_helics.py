"""HELICS: a value federate for each process, a broker in the hub; one time request a round.

One request a round is generous to HELICS: a federate sees the values of the round before, while in lock-step an agent
waits for the measurement of the same tick.
"""

from __future__ import annotations

from pathlib import Path
from time import monotonic, perf_counter, sleep
from typing import Any

import helics

from bench.peers.mesh import DEADLINE, MeshMember
from bench.peers.mesh_process import WARM_UP
from scenarios.drivers.free_endpoint import free_endpoint

BROKER_LEAVES = 2000
"""Longest time (ms) for the broker to see all federates off."""


def run_federate(member: MeshMember) -> float:
    """Be one federate; return the seconds of the rounds that count."""
    core = member.transport.removeprefix("helics-")
    broker: Any = None
    address = Path(member.folder) / "address"
    if member.is_hub:
        port = free_endpoint().rpartition(":")[2]
        options = f"-f {1 + len(member.hosts)} --loglevel=no_print --localinterface=tcp://127.0.0.1:{port}"
        broker = helics.helicsCreateBroker(core, "", options)
        if not helics.helicsBrokerIsConnected(broker):
            raise RuntimeError(f"no {core} broker at port {port}")
        partial = address.with_suffix(".partial")
        partial.write_text(helics.helicsBrokerGetAddress(broker))
        partial.rename(address)
    until = monotonic() + DEADLINE
    while not address.exists():
        if monotonic() > until:
            raise TimeoutError("no broker")
        sleep(0.005)
    info = helics.helicsCreateFederateInfo()
    helics.helicsFederateInfoSetCoreTypeFromString(info, core)
    options = f"--federates=1 --loglevel=no_print --broker_address={address.read_text()}"
    helics.helicsFederateInfoSetCoreInitString(
        info, f"{options} --localinterface={'tcp://' * (core == 'zmq')}127.0.0.1"
    )
    helics.helicsFederateInfoSetFlagOption(info, helics.HELICS_FLAG_UNINTERRUPTIBLE, True)
    federate = helics.helicsCreateValueFederate(member.name, info)
    raw = helics.HELICS_DATA_TYPE_STRING
    topics = [f"measurement/{agent}" for agent in member.heard] if member.is_hub else []
    topics += [f"state/{agent}" for agent in member.agents]
    outputs = [helics.helicsFederateRegisterGlobalPublication(federate, topic, raw, "") for topic in topics]
    wanted = [f"state/{agent}" for agent in member.heard] + [f"measurement/{agent}" for agent in member.agents]
    inputs = [helics.helicsFederateRegisterSubscription(federate, topic, "") for topic in wanted]
    text = "x" * (member.measurement_size if member.is_hub else member.state_size)
    helics.helicsFederateEnterExecutingMode(federate)
    began = 0.0
    for k in range(WARM_UP + member.rounds):
        if k == WARM_UP:
            began = perf_counter()
        for output in outputs:
            helics.helicsPublicationPublishString(output, text)
        helics.helicsFederateRequestTime(federate, float(k + 1))
        for each in inputs:
            if helics.helicsInputIsUpdated(each):
                helics.helicsInputGetString(each)
    seconds = perf_counter() - began
    helics.helicsFederateDisconnect(federate)
    if broker is not None:
        helics.helicsBrokerWaitForDisconnect(broker, BROKER_LEAVES)
    helics.helicsCloseLibrary()
    return seconds
