"""Time and memory of an islanding on a large feeder: 8500 nodes, 50 inverters with agents, all in one process.

    .venv/bin/python -m bench.large_feeder [--customers 1500] [--inverters 50] [--end 6]

The feeder is made here: three three-phase feeders of a substation with single-phase laterals; each customer has a
centre-tapped transformer, a service cable and two loads. It is written as a script for OpenDSS, imported (extra
`opendss`), given the inverters that `gridpeers init --feeder` proposes, and islanded at 1 s, without control and with
all agents on the graph "clustered". Ratios to real time are of processor time: below 1 is faster than real time.
"""

from __future__ import annotations

import resource
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter, process_time

from bench.harness import machine, options
from gridpeers.feeder import Feeder
from plant.build import build_plant
from scenarios.drivers.inprocess import run_inprocess
from scenarios.proposal.feeder_proposal import propose
from scenarios.results.record import Recorder
from scenarios.schema import load_scenario
from scenarios.schema.configs import configs

TRUNKS, LATERAL = 3, 4
"""Three-phase feeders of the substation, and customers of a lateral."""

HEADER = """\
Clear
Set DefaultBaseFrequency=60
New Circuit.large bus1=hv basekv=115 pu=1.0 MVAsc3=2000 MVAsc1=1500
New Transformer.sub phases=3 buses=(hv sub) conns=(delta wye) kvs=(115 12.47) kvas=(20000 20000) xhl=8 %loadloss=0.5
New LineCode.trunk nphases=3 units=km r1=0.19 x1=0.38 r0=0.45 x0=1.15 c1=10 c0=5
New LineCode.lateral nphases=1 units=km
~ rmatrix=(0.7) xmatrix=(0.8) cmatrix=(8)
New LineCode.service nphases=2 units=km
~ rmatrix=(0.5 | 0.1 0.5) xmatrix=(0.3 | 0.12 0.3) cmatrix=(0 | 0 0)
New Line.head bus1=sub bus2=main phases=3 linecode=trunk length=0.05
"""

CUSTOMER = """\
New Line.l{k} phases=1 bus1={above}.{phase} bus2=p{k}.{phase} linecode=lateral length=0.08
New Transformer.t{k} phases=1 windings=3 buses=(p{k}.{phase} s{k}.1.0 s{k}.0.2) kvs=(7.2 0.12 0.12) kvas=(25 25 25)
~ xhl=2.04 xht=2.04 xlt=1.36 %rs=(0.6 1.2 1.2)
New Line.v{k} phases=2 bus1=s{k}.1.2 bus2=m{k}.1.2 linecode=service length=0.03
New Load.a{k} phases=1 bus1=m{k}.1 kv=0.12 kw={kW} pf=0.95 model=1 vminpu=0.88
New Load.b{k} phases=1 bus1=m{k}.2 kv=0.12 kw={kW} pf=0.95 model=2 vminpu=0.88
"""


def script(customers: int) -> Iterator[str]:
    """Yield the text of a feeder with so many customers."""
    yield HEADER
    for k in range(customers):
        lateral, along = divmod(k, LATERAL)
        trunk, place = lateral % TRUNKS, lateral // TRUNKS
        bus = f"b{trunk}_{place}"
        if not along:
            before = f"b{trunk}_{place - 1}" if place else "main"
            yield f"New Line.{bus} bus1={before} bus2={bus} phases=3 linecode=trunk length=0.06\n"
        above = f"p{k - 1}" if along else bus
        yield CUSTOMER.format(k=k, above=above, phase=1 + lateral // TRUNKS % 3, kW=3.0 + k * 7 % 5)
    yield "Set VoltageBases=(115 12.47 0.208)\nCalcVoltageBases\nSolve\n"


SCENARIO = """\
name = "large"
title = "islanding of a large feeder"
[plant]
feeder = "large"
P_set0_pu = {P_set0}
[time]
end_s = {end}
[[event]]
label = "islanding"
t_s = 1.0
open = ["{switch}"]
[case.none]
title = "droop alone"
secondary = "none"
graph = "none"
[case.clustered]
title = "all agents"
secondary = "all"
graph = "clustered"
"""


def megabytes() -> float:
    """Return the largest size of this process so far (MB)."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak / 1e3


def main() -> None:
    """Measure and print."""
    given = options(__doc__, customers=1500, inverters=50, end=6)
    print(machine())
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        (folder / "Master.dss").write_text("".join(script(given.customers)), encoding="utf-8")
        began = process_time()
        feeder = Feeder.from_opendss(folder / "Master.dss", switches=["Line.head"])
        print(f"import {process_time() - began:.2f} s: {sum(len(bus.phases) for bus in feeder.buses)} nodes")
        proposal = propose(feeder, given.inverters)
        for row in proposal.inverters:
            feeder = feeder.add_inverter(row.name, row.bus, row.kind, row.P_rated, microgrid=row.microgrid)
        feeder.save(folder / "large")
        scenario_file = folder / "large.toml"
        scenario_file.write_text(
            SCENARIO.format(P_set0=proposal.P_set0, end=float(given.end), switch=proposal.switch), encoding="utf-8"
        )
        began = process_time()
        scenario, tables = load_scenario(str(scenario_file))
        print(f"reading its tables {process_time() - began:.2f} s")
        build_plant(configs(scenario, tables, "none")[0])  # loads the compiled step
        for case in scenario.cases:
            plant, agents = configs(scenario, tables, case)
            began = process_time()
            built = build_plant(plant)
            build, began, wall = process_time() - began, process_time(), perf_counter()
            with Recorder(folder / case) as recorder:
                outcome = run_inprocess(plant, agents, recorder, plant=built)
                recorder.finish(given.end, plant.record_step)
            assert not outcome.broke, outcome.broke
            trips = sum(event.kind == "trip" for event in recorder.events)
            spent, passed = process_time() - began, perf_counter() - wall
            print(
                f"case {case}: build {build:.2f} s, {given.end} s with {len(agents)} inverters in {spent:.2f} s: "
                f"{spent / given.end:.2f} of real time ({passed / given.end:.2f} on the clock), {trips} trips"
            )
    print(f"largest memory {megabytes():.0f} MB")


if __name__ == "__main__":
    main()
