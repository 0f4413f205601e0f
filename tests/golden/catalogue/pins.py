"""The pinned results of the catalogue: what is pinned, in which numerical environment, and how a case is run."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from threadpoolctl import threadpool_info

from gridpeers.scenarios.catalogue_files import CATALOGUE, names_in
from gridpeers.scenarios.drivers.free_endpoint import local_endpoint
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.results.record import Recorded, Recorder
from gridpeers.scenarios.run_request import Outcome
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.configs import configs

FILE = Path(__file__).parent / "hashes.toml"  # The pins
QUANTITIES = ("f_Hz", "P_W", "Q_var", "V_V", "P_set_W", "V_set_V")  # What the last row of the first inverter has


class Pin(NamedTuple):
    """Result of one case."""

    sha256: str
    """Fingerprint of its rows; empty where it is not known yet."""
    last: tuple[float, ...]
    """Last row of the first inverter, in the order of `QUANTITIES`."""


def cases() -> list[tuple[str, str]]:
    return [(name, case) for name in names_in(CATALOGUE) for case in load_scenario(name)[0].cases]


@cache
def ran(name: str, case: str) -> tuple[Recorded, Outcome]:
    """Run one case in this process, once for all who ask."""
    scenario, feeder = load_scenario(name)
    plant, agents = configs(scenario, feeder, case, local_endpoint(0))
    recorder = Recorder()
    outcome = run_inprocess(plant, agents, recorder)
    return recorder.finish(scenario.time.end_s, plant.record_step), outcome


def run_case(name: str, case: str) -> Pin:
    recorded, _ = ran(name, case)
    return Pin(recorded.sha256, tuple(recorded.history.table[-1, 1 : 1 + len(QUANTITIES)].tolist()))


def environment() -> dict[str, str]:
    """Versions that decide the last digits: numerical packages, and the processor type that OpenBLAS found."""
    np.ones((2, 2)) @ np.ones((2, 2))
    kernels = {str(pool.get("architecture", "")) for pool in threadpool_info() if pool["user_api"] == "blas"}
    versions = {package: metadata.version(package) for package in ("numpy", "scipy", "numba")}
    return {**versions, "blas": " ".join(sorted(kernels))}


def vector_level() -> str:
    """Return the highest level of vector instructions that numpy uses here, e.g. "X86_V3" (AVX2) or "X86_V4" (AVX-512).

    Its functions differ by it in the last digit, and no setting makes a processor without AVX-512 do as one with it.
    """
    found = np.show_config(mode="dicts")["SIMD Extensions"]["found"]  # type: ignore[call-overload,index]
    return max((level for level in found if level.startswith("X86_V")), default="")


class Pinned(NamedTuple):
    """The file of the pins."""

    pins: dict[tuple[str, str], Pin]
    """By scenario and case."""
    otherwise: dict[str, dict[tuple[str, str], Pin]]
    """Pins that are others on processors of a vector level, by that level."""
    environment: dict[str, str]
    """Versions that decide the last digits."""
    moved: list[dict[str, str]]
    """When, where and why the pins moved, oldest first."""

    def here(self) -> dict[tuple[str, str], Pin]:
        """Return the pins that hold on this processor."""
        return self.pins | self.otherwise.get(vector_level(), {})


def read() -> Pinned:
    whole = tomllib.loads(FILE.read_text(encoding="utf-8"))
    otherwise = {level: _pins(tables) for level, tables in whole.get("otherwise", {}).items()}
    return Pinned(_pins(whole["pin"]), otherwise, whole["environment"], whole["moved"])


def _pins(tables: dict[str, dict[str, dict[str, Any]]]) -> dict[tuple[str, str], Pin]:
    return {
        (name, case): Pin(pin["sha256"], tuple(pin["last"]))
        for name, of_cases in tables.items()
        for case, pin in of_cases.items()
    }
