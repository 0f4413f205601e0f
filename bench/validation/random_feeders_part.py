"""Part (f): random feeders beside OpenDSS, at the start, after a load step, and after a switching."""

from __future__ import annotations

import tempfile
from functools import partial
from pathlib import Path
from typing import get_args

import numpy as np

from bench.validation.opendss.difference_figure import difference_figure
from bench.validation.opendss.opendss_engines import ENGINES, SolvedStates, solve_scripts
from bench.validation.random_feeders.feeder_states import FeederStates, run_states
from bench.validation.random_feeders.random_script import Shape, random_feeder
from bench.validation.validation_part import CaseResult, ToleranceCheck, ValidationPart
from plant.dynamics import PlantError
from plant.tables import FeederError

LIMIT = 1e-6
"""Largest difference of a phasor (pu of nominal voltage), and largest current that is left at a node (A)."""

ALL, IN_TESTS = 250, 12
"""Feeders of a case."""

TEXT = f"""
Random feeders, {ALL} radial and {ALL} with meshes, as scripts that we import: sections that are not symmetric
(y12 unlike y21, as of a `Reactor` with z2 unlike z1), wye-wye, delta-wye, wye-delta, delta-delta and single-phase
transformers, floating star points, four-wire networks with a neutral earthed through impedances, laterals of one and of
two phases, and cables with an open end. On them are one to four inverters, GFM and GFL, of three phases
and of one, that return through earth or to the neutral.

- Our inner loop starts them, changes a load, and 20 ms later opens a line, which mostly makes an island.
- Kirchhoff's current law holds at every node to {LIMIT:g} A, at the start, in each event's step and 20 ms later, by the
  voltages that the inner loop finds: sparse factors, and dense matrices for every fourth feeder.
- The start is that of `solve_power_flow` with the inverters' powers.
- Both OpenDSS engines, with the inverters' powers held at ours and an island's first GFM as a stiff source, have our
  phasors at every node, within {LIMIT:g} pu.
- A feeder that we refuse and an engine solves breaks a limit.

Delta windings that feed have `ppm_antifloat=10000`. With OpenDSS's default of 1 ppm their inductance to ground can
resonate with a few meters of cable: the neutral is then at up to 38 pu, and rounding moves it by 1e-4 pu in either
engine and here; four of 500 such feeders differed by more than {LIMIT:g} pu, and the engines from each other.
"""

CASES = {"radial": f"{ALL} radial feeders", "meshed": f"{ALL} feeders with meshes"}


def _run(case: str, count: int = ALL) -> CaseResult:
    shape = next(shape for shape in get_args(Shape) if shape == case)
    with tempfile.TemporaryDirectory() as folder:
        scripts, found, refused = list[Path](), list[FeederStates](), list[Path]()
        for seed in range(count):
            drawn, script = random_feeder(seed, shape), Path(folder) / f"{case}{seed}.dss"
            script.write_text(drawn.script, encoding="utf-8")
            try:
                found.append(run_states(drawn, script, dense=seed % 4 == 3))
                scripts.append(script)
            except (FeederError, PlantError, ArithmeticError):
                refused.append(script)
        checks, curves = list[ToleranceCheck](), {}
        falsely = set[Path]()
        for engine in ENGINES:
            theirs = solve_scripts(engine, [(script, s.commands) for script, s in zip(scripts, found, strict=True)])
            curves[engine] = np.array([_largest(*pair) for pair in zip(found, theirs, strict=True)])
            checks.append(ToleranceCheck(f"V, pu, {engine}", float(curves[engine].max()), LIMIT))
            plain = solve_scripts(engine, [(script, [()]) for script in refused])
            falsely |= {script for script, each in zip(refused, plain, strict=True) if np.isfinite(each.V).all()}
    checks += [
        ToleranceCheck("start, pu, `solve_power_flow`", max(states.start for states in found), LIMIT),
        ToleranceCheck("current left, A", max(states.residual for states in found), LIMIT),
        ToleranceCheck("refused, but solved by an engine", float(len(falsely)), 0.0),
    ]
    facts = {
        "feeders": str(count),
        "refused": str(len(refused)),
        "asymmetric": str(sum(states.asymmetry > 1e-3 for states in found)),
        "with an island": str(sum(states.islanded > 0 for states in found)),
        "nodes": str(sum(len(states.names) for states in found)),
    }
    return CaseResult(case, tuple(checks), facts, curves)


def _largest(ours: FeederStates, theirs: SolvedStates) -> float:
    """Return the largest difference (pu) at any node of the engine in any state; nan where it found none."""
    at = [ours.names.index(name) for name in theirs.nodes]
    gaps = [np.abs(V[at] - theirs.V[k]) / ours.V_nom[at] for k, V in enumerate(ours.V)]
    return float(np.max(gaps))


RANDOM_FEEDERS = ValidationPart(
    "random-feeders",
    "Random feeders, beside OpenDSS",
    TEXT,
    ENGINES,
    CASES,
    _run,
    partial(difference_figure, limit=LIMIT, of="feeders", what="largest difference of V in a feeder"),
    partial(_run, count=IN_TESTS),
)
