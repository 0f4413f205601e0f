"""The table and the figure of docs/hostile.md: attack x graph x defence, each a run of the scenario hostile.

python -m bench.tables.hostile_table [FIGURE.png]
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from scenarios.catalogue_files import CATALOGUE
from scenarios.drivers.free_endpoint import local_endpoint
from scenarios.drivers.inprocess import run_inprocess
from scenarios.results.history import Floats
from scenarios.schema import load_scenario
from scenarios.schema.configs import configs

SINCE = 2.5
"""When the lies begin (s)."""

OFFSET = '{ model = "offset", P_set_W = 1e5, Q_var = 1e5 }'


def _liar(name: str, lies: str, since: float = SINCE) -> str:
    return f'[[node]]\nname = "{name}"\nfrom_s = {since}\nlies = {lies}\n'


ATTACKS = {
    "nobody lies": "",
    "small offset, 0.09 pu, one": _liar("inv2", '{ model = "offset", P_set_W = 3e4, Q_var = 3e4 }'),
    "offset, 0.29 pu, one": _liar("inv2", OFFSET),
    "offset, two": _liar("inv2", OFFSET) + _liar("inv5", OFFSET),
    "extreme, one": _liar("inv2", '{ model = "extreme" }'),
    "extreme, two": _liar("inv2", '{ model = "extreme" }') + _liar("inv5", '{ model = "extreme" }'),
    "extreme, alternate, one": _liar("inv2", '{ model = "extreme", side = "alternate" }'),
    "freeze at 1.1 s, one": _liar("inv2", '{ model = "freeze" }', 1.1),
    "random, 0.29 pu, one": _liar("inv2", '{ model = "random", P_set_W = 1e5, Q_var = 1e5 }'),
    "a leader and its inverter": _liar("inv1", '{ model = "offset", P_set_W = 1e5, plant = true }'),
    "in a leader's name, to the plant": _liar(
        "inv2", '{ model = "offset", P_set_W = 1e5, plant = true, in_name_of = "inv1" }'
    ),
    "old bytes, all twice": f'[[link]]\non = "inv2 -> *"\nfrom_s = {SINCE}\n'
    "duplicate = { p = 1.0, extra_delay_s = 0.5 }\n",
}
"""By name: entries of a scenario."""

DEFENCES = {
    "paper": '"consensus"',
    "plausible": '{ use = "resilient", F = 0, tolerance = 0.1, T_out = 0.5 }',
    "rate": '{ use = "resilient", F = 0, rate = 0.5 }',
    "F = 1": '{ use = "resilient", F = 1 }',
    "F = 2": '{ use = "resilient", F = 2 }',
    "all": '{ use = "resilient", F = 2, tolerance = 0.1, rate = 2.0, T_out = 0.5 }',
}
"""By name: the law."""


class Measured(NamedTuple):
    """One run."""

    t: Floats
    """Times (s)."""
    f_error: Floats
    """Largest frequency error of all inverters (Hz)."""
    spread: float
    """Largest less smallest P at the end (pu)."""
    S: float
    """Largest apparent power since the lies began (pu)."""
    V: tuple[float, float]
    """Least and greatest voltage since then (pu)."""

    @property
    def f_end(self) -> float:
        """Largest frequency error of the last half second (Hz)."""
        return float(self.f_error[self.t >= self.t[-1] - 0.5].max())


def measured(path: Path, case: str) -> Measured:
    """Run a case in this process."""
    scenario, feeder = load_scenario(path)
    plant, agents = configs(scenario, feeder, case, local_endpoint(0))
    rows: list[tuple[float, ...]] = []
    outcome = run_inprocess(plant, agents, lambda telemetry: rows.extend(telemetry.rows))
    if outcome.broke:
        raise RuntimeError(f"{path} {case}: {outcome.broke}")
    table = np.array(rows)
    t, values = table[:, 0], table[:, 1:].reshape(len(table), len(agents), -1)
    ratings, nominal = np.array([it.P_rated for it in agents]), np.array([it.V_nom for it in agents])
    f_error = np.abs(values[:, :, 0] - agents[0].f_nom).max(axis=1)
    P, Q, V = values[:, :, 1] / ratings, values[:, :, 2] / ratings, values[:, :, 3] / nominal
    late = t >= SINCE
    return Measured(
        t,
        f_error,
        float(np.ptp(P[-1])),
        float(np.hypot(P, Q)[late].max()),
        (float(V[late].min()), float(V[late].max())),
    )


def table_of(graph: str, folder: Path) -> Iterator[str]:
    """Yield the rows of one graph."""
    head = (CATALOGUE / "hostile.toml").read_text(encoding="utf-8").partition("[case.truth]")[0]
    yield "| attack | " + " | ".join(DEFENCES) + " |"
    yield "|---|" + "---|" * len(DEFENCES)
    for attack, entries in ATTACKS.items():
        cells = []
        for law in DEFENCES.values():
            path = folder / "x.toml"
            path.write_text(f'{head}[case.x]\nsecondary = "all"\ngraph = "{graph}"\nlaw = {law}\n{entries}', "utf-8")
            run = measured(path, "x")
            cells.append(f"{run.f_end:.3f} / {run.spread:.2f} / {run.S:.2f} / {run.V[0]:.2f}..{run.V[1]:.2f}")
        yield f"| {attack} | " + " | ".join(cells) + " |"


def figure(path: Path) -> None:
    """Draw the frequency errors of the cases of the scenario hostile."""
    import matplotlib.pyplot as plt

    cases = load_scenario(CATALOGUE / "hostile.toml")[0].cases
    fig, axes = plt.subplots(3, 3, figsize=(10, 6), sharex=True, sharey=True, layout="constrained")
    for ax, (name, case) in zip(axes.flat, cases.items(), strict=True):
        run = measured(CATALOGUE / "hostile.toml", name)
        ax.semilogy(run.t, np.maximum(run.f_error, 1e-5))
        ax.axhline(0.01, color="0.6", lw=0.8)
        ax.axvline(SINCE, color="tab:red", lw=0.8)
        ax.set_title(f"{name}: {case.title}", fontsize=7)
    fig.supxlabel("t (s)")
    fig.supylabel("largest |f - 60 Hz| (Hz)")
    fig.savefig(path, dpi=110)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        figure(Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as folder:
            for graph in ("full", "clustered"):
                print(graph, *table_of(graph, Path(folder)), sep="\n", flush=True)
