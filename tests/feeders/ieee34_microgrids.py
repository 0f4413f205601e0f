"""The feeder "ieee34" of plant/data, made from the IEEE 34-node feeder beside this file and our modifications.

    .venv/bin/python -m tests.feeders.ieee34_microgrids        writes plant/data/ieee34 anew; needs the extra opendss

plant/data/README.md says what is modified, and why.
"""

from __future__ import annotations

import re
import tempfile
from pathlib import Path
from typing import Literal

from msgspec.structs import replace

import gridpeers.plant.data
from gridpeers.bridges.opendss import read_opendss
from gridpeers.plant.equipment import InverterRow, Tables
from gridpeers.plant.tables.write import write_feeder

SCRIPT = Path(__file__).parent / "ieee34.dss"

SWITCHES = {"812-814": "sw0", "832-858": "sw1_2", "834-860": "sw2_3"}
"""Lines that get a switch at their first bus, and its alias. The bus between switch and line gets an "s"."""

INVERTERS: tuple[tuple[Literal["GFM", "GFL"], str, str, float], ...] = (
    ("GFM", "824", "MG1", 500.0),
    ("GFM", "854", "MG1", 250.0),
    ("GFL", "890", "MG1", 350.0),
    ("GFL", "858", "MG2", 230.0),
    ("GFM", "844", "MG2", 480.0),
    ("GFL", "848", "MG2", 250.0),
    ("GFL", "860", "MG3", 120.0),
    ("GFM", "836", "MG3", 220.0),
    ("GFL", "862", "MG3", 110.0),
)
"""Kind, bus, microgrid and rating (kW)."""

PLACES = {
    "rest": "800~source -1 0, 800 0 0, 802 1 0, 806 2 0, 808 3 0, 810 3 -1, 812 4 0",
    "MG1": "812s 4.5 0, 814 5 0, rg10 5.5 0, 850 6 0, 816 7 0, 818 7 1, 820 7 2, 822 7 3, 824 8 0, 826 8 -1, 828 9 0, "
    "830 10 0, 854 11 0, 856 11 -1, 852 12 0, rg11 12.5 0, 832 13 0, 888 13 1, 890 13 2",
    "MG2": "832s 13.5 0, 858 14.5 0, 864 14.5 -1, 834 16 0, 842 16 1, 844 16 2, 846 16 3, 848 16 4",
    "MG3": "834s 16.5 0, 860 17.5 0, 836 18.5 0, 840 19.5 0, 862 18.5 -1, 838 18.5 -2",
}
"""Buses of each zone, with drawing coordinates of ours (units)."""


def ieee34_microgrids() -> Tables:
    text = SCRIPT.read_text(encoding="utf-8")
    text = re.sub(r"taps=\(1 [\d.]+\)", "taps=(1 1)", text).replace("pu=1.05", "pu=1.0")
    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder) / "ieee34.dss"
        script.write_text(text, encoding="utf-8")
        feeder = read_opendss(script, switches=[f"Line.{line}" for line in SWITCHES])
    between = {f"{line[:3]}~{line}": f"{line[:3]}s" for line in SWITCHES}
    at = {
        name: (zone, float(x), float(y))
        for zone, rows in PLACES.items()
        for name, x, y in (row.split() for row in rows.split(", "))
    }

    def renamed(bus: str) -> str:
        return between.get(bus, bus)

    buses = [replace(bus, name=renamed(bus.name)) for bus in feeder.buses]
    V_nom = {bus.name: bus.V_nom for bus in buses}
    return replace(
        feeder,
        name="ieee34",
        buses=tuple(replace(bus, zone=at[bus.name][0], x=at[bus.name][1], y=at[bus.name][2]) for bus in buses),
        elements=tuple(
            replace(element, nodes=tuple((renamed(bus), phase) for bus, phase in element.nodes))
            for element in feeder.elements
        ),
        switches=tuple(
            replace(
                switch,
                name=f"{renamed(switch.from_bus)}-{renamed(switch.to_bus)}",
                alias=SWITCHES[switch.alias],
                from_bus=renamed(switch.from_bus),
                to_bus=renamed(switch.to_bus),
            )
            for switch in feeder.switches
        ),
        inverters=tuple(
            InverterRow(
                name=f"inv{k}",
                kind=kind,
                bus=bus,
                microgrid=microgrid,
                P_rated=1e3 * rating,
                V_nom=V_nom[bus],
                m_p=0.01,
                m_q=0.05,
            )
            for k, (kind, bus, microgrid, rating) in enumerate(INVERTERS, start=1)
        ),
    )


if __name__ == "__main__":
    write_feeder(ieee34_microgrids(), Path(gridpeers.plant.data.__path__[0]) / "ieee34")
