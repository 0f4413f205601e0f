"""The feeder of a record, and a diagram without it: a folder of one's own may have moved since the run."""

from __future__ import annotations

from math import cos, pi, sin

from gridpeers.plant.equipment import Feeder
from gridpeers.plant.tables import FeederError, read_feeder
from gridpeers.scenarios.live.feeder_map import FeederMap, MapInverter
from gridpeers.scenarios.record.record_info import RecordInfo


def feeder_of(info: RecordInfo) -> Feeder | None:
    """Return the feeder of a run; None if it is not here, or has other inverters now."""
    try:
        feeder = read_feeder(info.plant.settings.feeder, info.plant.settings.load_set)
    except (FeederError, OSError, ValueError):
        return None
    names = {row.name for row in (*feeder.inverters, *feeder.spares)}
    return feeder if names >= set(info.inverters) else None


def inverter_ring(info: RecordInfo) -> FeederMap:
    """Return a diagram that has the inverters of a run alone, in a ring, those of a microgrid beside each other."""
    configs = {config.name: config for config in info.agents}
    microgrids = list(dict.fromkeys(config.microgrid for config in info.agents))

    def group(name: str) -> int:
        return microgrids.index(configs[name].microgrid) if name in configs else len(microgrids)

    names = sorted(info.inverters, key=group)
    angles = [2.0 * pi * i / max(1, len(names)) for i in range(len(names))]
    return FeederMap(
        buses=tuple((name, sin(angle), cos(angle)) for name, angle in zip(names, angles, strict=True)),
        inverters=tuple(
            MapInverter(
                name,
                i,
                configs[name].kind if name in configs else "GFL",
                configs[name].microgrid if name in configs else "",
            )
            for i, name in enumerate(names)
        ),
    )
