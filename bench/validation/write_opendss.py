"""A feeder of our own tables as a script for OpenDSS."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import pi, sqrt

from gridpeers.plant.equipment import LineConfig, Load, Tables

NUMBER = {"A": "1", "B": "2", "C": "3"}
MODEL = {"P": 1, "Z": 2, "I": 5}

LIMITS = "vminpu=0.01 vlowpu=0.005 vmaxpu=9"
"""Loads of our tables keep their law at any voltage."""

IDEAL = "r1=1e-8 r0=1e-8 x1=0 x0=0 c1=0 c0=0 length=1"
"""Impedance in place of a switch (ohm)."""

IDEAL_SOURCE = "r1=0 r0=0 x1=1e-7 x0=1e-7"
"""Impedance of a stiff source (ohm)."""


def write_opendss(feeder: Tables) -> str:
    """Return a script with the feeder's source, lines, switches, regulators, transformers, capacitors and loads."""
    return "\n".join(_commands(feeder)) + "\n"


def _commands(feeder: Tables) -> Iterator[str]:
    source, kV = feeder.source, {bus.name: bus.V_nom * sqrt(3.0) / 1e3 for bus in feeder.buses}
    assert source is not None
    yield f"Clear\nSet DefaultBaseFrequency={feeder.f_nom!r}"
    yield (
        f"New Circuit.{feeder.name} bus1={source.bus} basekv={kV[source.bus]!r} pu={source.V_pu!r} "
        f"angle={source.angle * 180.0 / pi!r} {IDEAL_SOURCE}"
    )
    for config in feeder.line_configs:
        for phases in sorted({line.phases for line in feeder.lines if line.config == config.name}):
            yield _line_code(config, phases, feeder.f_nom)
    for line in feeder.lines:
        ends = f"bus1={_at(line.from_bus, line.phases)} bus2={_at(line.to_bus, line.phases)}"
        code = f"linecode={line.config}_{line.phases} length={line.length!r} units=km"
        yield f"New Line.{line.name} phases={len(line.phases)} {ends} {code}"
    for switch in feeder.switches:
        ends = f"bus1={_at(switch.from_bus, switch.phases)} bus2={_at(switch.to_bus, switch.phases)}"
        yield f"New Line.{switch.name} phases={len(switch.phases)} {ends} switch=yes {IDEAL}"
        if not switch.closed:
            yield f"Open Line.{switch.name} 1"
    for regulator in feeder.regulators:
        for phase in regulator.phases:
            V = kV[regulator.from_bus] / sqrt(3.0)
            yield (
                f"New Transformer.{regulator.name}{phase} phases=1 xhl=1e-6 %loadloss=1e-7 ppm_antifloat=0 buses=("
                f"{_at(regulator.from_bus, phase)} {_at(regulator.to_bus, phase)}) conns=(wye wye) kvs=({V!r} {V!r}) "
                f"kvas=(5000 5000) taps=(1 {regulator.ratio!r})"
            )
    for transformer in feeder.transformers:
        kind = "delta" if transformer.connection == "D-D" else "wye"
        kVA, first, second = transformer.S_rated / 1e3, kV[transformer.from_bus], kV[transformer.to_bus]
        yield (
            f"New Transformer.{transformer.name} phases=3 xhl={transformer.z.imag * 100!r} "
            f"%loadloss={transformer.z.real * 100!r} buses=({transformer.from_bus} {transformer.to_bus}) "
            f"conns=({kind} {kind}) kvs=({first!r} {second!r}) kvas=({kVA!r} {kVA!r})"
        )
    for i, bank in enumerate(feeder.capacitors):
        for phase, Q in zip("ABC", bank.Q, strict=True):
            if Q:
                rating = f"kvar={Q / 1e3!r} kv={bank.V_rated / 1e3!r}"
                yield f"New Capacitor.{i}{phase} bus1={_at(bank.bus, phase)} phases=1 {rating}"
    for i, load in enumerate(feeder.loads):
        yield from _loads(i, load, kV[load.bus])
    bases = " ".join(f"{V!r}" for V in sorted(set(kV.values())))
    yield f"Set VoltageBases=({bases})\nCalcVoltageBases\nSolve"


def _at(bus: str, phases: Iterable[str]) -> str:
    return ".".join([bus, *(NUMBER[phase] for phase in phases)])


def _line_code(config: LineConfig, phases: str, f_nom: float) -> str:
    keep = [config.phases.index(phase) for phase in phases]
    nF = 1e9 / (2.0 * pi * f_nom)
    rows = {
        "rmatrix": [[config.Z[i][j].real for j in keep] for i in keep],
        "xmatrix": [[config.Z[i][j].imag for j in keep] for i in keep],
        "cmatrix": [[config.B[i][j] * nF for j in keep] for i in keep],
    }
    text = " ".join(
        f"{name}=({' | '.join(' '.join(f'{value!r}' for value in row) for row in matrix)})"
        for name, matrix in rows.items()
    )
    return f"New LineCode.{config.name}_{phases} nphases={len(phases)} units=km {text}"


def _loads(number: int, load: Load, kV: float) -> Iterator[str]:
    delta = load.connection == "D"
    for k, S in enumerate(load.S):
        if S:
            phases = ("AB", "BC", "CA")[k] if delta else "ABC"[k]
            connection = f"conn=delta kv={kV!r}" if delta else f"conn=wye kv={kV / sqrt(3.0)!r}"
            power = f"model={MODEL[load.model]} kw={S.real / 1e3!r} kvar={S.imag / 1e3!r}"
            yield f"New Load.{number}{phases} phases=1 bus1={_at(load.bus, phases)} {connection} {power} {LIMITS}"
