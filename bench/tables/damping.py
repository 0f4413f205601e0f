"""GFL settings that settle on this feeder, for few and many GFL per GFM: the reason for the plant's defaults.

Each row islands the feeder at 0.1 s with some inverters removed and prints the largest peak-to-peak of any inverter's
power in the windows 0.5-1 s, 2-2.5 s and 5.5-6 s. A settled plant has zeros in the last; "no solution" means that the
network could not carry the inverters' powers. Protection is off, as it would trip the inverters that swing.

    .venv/bin/python -m bench.tables.damping
"""

from __future__ import annotations

from typing import Any

import numpy as np
from msgspec.structs import replace

from plant.dynamics import PlantError
from plant.feeder import Plant, raise_for_trip
from plant.network import Network
from plant.plant_config import GflParameters, PlantSettings, Protection, SwitchEvent
from plant.tables import read_feeder

FLEETS = {
    "3 GFM, 6 GFL": ((), ("13-152",)),
    "2 GFM, 6 GFL": (("inv4",), ("13-152", "60-160")),
    "1 GFM, 4 GFL": (("inv4", "inv7", "inv8", "inv9"), ("13-152", "60-160")),
}
SETTINGS: dict[str, dict[str, Any]] = {
    "defaults": {},
    "F_current 0": {"F_current": 0.0},
    "F_current 0.3": {"F_current": 0.3},
    "F_current 0.4": {"F_current": 0.4},
    "F_current 0.8": {"F_current": 0.8},
    "T_vf 0.02, T_qf 0.05 s": {"T_vf": 0.02, "T_qf": 0.05},
    "T_qf 0.05 s": {"T_qf": 0.05},
    "T_qf 0.2 s": {"T_qf": 0.2},
    "current source": {"model": "current_source"},
}
WINDOWS = ((0.5, 1.0), (2.0, 2.5), (5.5, 6.0))


def ripple(removed: tuple[str, ...], switches: tuple[str, ...], gfl: GflParameters) -> str:
    """Return the peak-to-peak power (kW) in each window."""
    feeder = read_feeder("microgrid123", "main")
    feeder = replace(feeder, inverters=tuple(unit for unit in feeder.inverters if unit.name not in removed))
    events = tuple(SwitchEvent(t=0.1, switch=name, action="open") for name in switches)
    try:
        settings = PlantSettings(events=events, gfl=gfl, protection=Protection(category="off"))
        plant = Plant(Network(feeder), settings, 0.02, 0.02)
        for _ in range(300):
            plant.advance()
        raise_for_trip(plant.take_events())
    except PlantError:
        return "no solution"
    rows = np.array(plant.take_rows())
    t, P = rows[:, 0], rows[:, 2::6] / 1e3
    return "".join(f"{np.ptp(P[(t > a) & (t <= b)], axis=0).max():10.2f}" for a, b in WINDOWS)


def main() -> None:
    """Print the table."""
    print(f"{'':24s}{'':16s}" + "".join(f"{f'{a:g}-{b:g} s':>10s}" for a, b in WINDOWS) + "   (kW peak to peak)")
    for label, changed in SETTINGS.items():
        for fleet, (removed, switches) in FLEETS.items():
            print(f"{label:24s}{fleet:16s}{ripple(removed, switches, GflParameters(**changed))}")


if __name__ == "__main__":
    main()
