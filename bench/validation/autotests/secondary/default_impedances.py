"""The impedances that GridLAB-D gives to closed switches and regulators by default, put into our feeder.

The autotest has them, and needs them: a machine and an inverter are at the two ends of a closed switch. So each gets
its impedance in our network, as a short line in series.
"""

from __future__ import annotations

from msgspec.structs import replace

from plant.equipment import Bus, Feeder, Line, LineConfig

Z_SWITCH = 1e-4 - 1e-4j
"""Of each phase of a closed switch (ohm); found by fitting, good to 1e-9 ohm."""

Z_REGULATOR = 1e-4 + 0j
"""Of each phase of a regulator, on its regulated side (ohm): GridLAB-D's `default_resistance`."""


def with_impedances(feeder: Feeder) -> Feeder:
    """Give the feeder with an impedance in series with every switch and every regulator."""
    V_nom = {bus.name: bus.V_nom for bus in feeder.buses}
    phases: dict[tuple[str, str], str] = {}
    lines: list[Line] = []

    def between(device: str, bus: str, phase: str, config: str) -> str:
        """Put the impedance between a device and its bus; returns the new bus, where the device goes."""
        new = f"{device}~{bus}"
        phases[new, bus] = "".join(sorted(phases.get((new, bus), "") + phase))
        lines.append(Line(name=f"{new} {phase}", from_bus=new, to_bus=bus, phases=phase, config=config, length=1.0))
        return new

    switches = tuple(
        replace(switch, from_bus=between(switch.name, switch.from_bus, switch.phases, "switch"))
        for switch in feeder.switches
    )
    regulators = tuple(
        replace(unit, to_bus=between(unit.name, unit.to_bus, unit.phases, "regulator")) for unit in feeder.regulators
    )
    buses = tuple(Bus(name=new, phases=of, V_nom=V_nom[bus]) for (new, bus), of in phases.items())
    configs = (_config("switch", Z_SWITCH), _config("regulator", Z_REGULATOR))
    return replace(
        feeder,
        buses=(*feeder.buses, *buses),
        lines=(*feeder.lines, *lines),
        line_configs=(*feeder.line_configs, *configs),
        switches=switches,
        regulators=regulators,
    )


def _config(name: str, Z: complex) -> LineConfig:
    """Give a kind of line with this impedance per km, without coupling between its phases."""
    series = tuple(tuple(Z if i == j else 0j for j in range(3)) for i in range(3))
    return LineConfig(name=name, phases="ABC", Z=series, B=((0.0,) * 3,) * 3)
