"""The fork servers of this process: they stay until it ends, so that only its first run waits for what they import.

They import beside what this process does meanwhile: a command prepares them before it reads its scenario.
"""

from __future__ import annotations

import atexit
import os
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from gridpeers.scenarios.drivers.forking import AVAILABLE, ForkServer, ForkServerError

_OF_AGENTS = (
    "gridpeers.wire.driver.session:load_zenoh",
    "gridpeers.agents.agent_process",
    "gridpeers.agents.laws.consensus",
)
"""Modules, and a function to call, that the fork server loads once for all agents."""

_OF_PLANTS = (
    *("gridpeers.wire.driver.session:load_zenoh", "gridpeers.plant.plant_process"),
    *("gridpeers.plant.build", "gridpeers.plant.build:load_kernels"),
)
"""The same for plants. Agents have another server, because they do not load numpy."""

_OF_FIGURES = ("gridpeers.scenarios.results.plots.drawing_process",)
"""The same for processes that draw."""

_ONE_BLAS_THREAD = {"OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
"""A server may have no other threads, and the plant uses one anyway."""


_SET_BY_US = {"ZENOH_RUNTIME", "KMP_DUPLICATE_LIB_OK"}
"""Variables that loading Zenoh, and threadpoolctl, sets here as it does there."""


class _Surroundings(NamedTuple):
    """What a server has inherited: once it differs, another server is needed."""

    owner: int
    """Process that has started it."""
    folder: Path
    variables: dict[str, str]


_kept: dict[tuple[str, ...], tuple[_Surroundings, ForkServer]] = {}
"""The server of each set of modules."""


def agent_server(module: str = "gridpeers.agents", *, start: bool = True) -> ForkServer | None:
    """Return the server that forks agents, and start it if it is worth it; None where there is none."""
    preload = *_OF_AGENTS, module
    return _kept_server(preload) if start or preload in _kept else None


def plant_server() -> ForkServer | None:
    """Return the server that forks plants, and start it if there is none; None where this system cannot fork so."""
    return _kept_server(_OF_PLANTS, _ONE_BLAS_THREAD)


def figure_server(*, start: bool = True) -> ForkServer | None:
    """Return the server that forks processes that draw; if there is none, start it if so wished, else return None."""
    return _kept_server(_OF_FIGURES, _ONE_BLAS_THREAD) if start or _OF_FIGURES in _kept else None


def prepare() -> None:
    """Start the servers of a run with processes, so that they have imported once it begins."""
    plant_server()
    agent_server()


def release() -> None:
    """End the servers: for a process that goes on for long and starts few others from now on."""
    _close_all(os.getpid())


def _kept_server(preload: tuple[str, ...], environment: Mapping[str, str] = MappingProxyType({})) -> ForkServer | None:
    """Return the server with these modules, and start it if there is none; parameters are those of `ForkServer`."""
    if not AVAILABLE:
        return None
    variables = {name: value for name, value in os.environ.items() if name not in _SET_BY_US}
    try:
        surroundings = _Surroundings(os.getpid(), Path.cwd(), variables)
    except OSError:  # the working directory has been deleted
        return None
    if preload in _kept:
        before, server = _kept[preload]
        if before == surroundings and server.lives:
            return server
        del _kept[preload]
        if before.owner == surroundings.owner:  # else it is the server of the process that has forked this one
            server.close()
    try:
        server = ForkServer(preload, environment)
    except (ForkServerError, OSError):
        return None
    if not _kept:
        atexit.unregister(_close_all)
        atexit.register(_close_all, os.getpid())
    _kept[preload] = surroundings, server
    return server


def _close_all(owner: int) -> None:
    """End all servers at the end of the process that owns them."""
    while _kept and os.getpid() == owner:
        _kept.popitem()[1][1].close()
