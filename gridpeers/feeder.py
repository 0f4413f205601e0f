"""Feeders in Python: from tables, or from files of OpenDSS or GridLAB-D."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from msgspec.structs import replace

from gridpeers.plant.equipment import NODES, PHASES, InverterRow, Tables
from gridpeers.plant.equipment.imported_equipment import is_behind
from gridpeers.plant.equipment.neutrals import neutral_for, neutrals_of
from gridpeers.rooms import READERS
from gridpeers.wire.wording import InputError, suggestion

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


Names = Sequence[str]  # Several names; a text counts as one name


class Feeder(Tables, frozen=True, kw_only=True):
    """A feeder: its buses, branches, switches, loads and inverters. It never changes; methods return a new one.

    >>> feeder = Feeder.read("microgrid123")
    >>> feeder
    <Feeder microgrid123: buses 134, switches 10, inverters 9, loads 88>
    >>> feeder = feeder.add_inverter("inv11", bus="87", kind="GFL", P_rated=2e5)
    >>> len(feeder.inverters), round(float(feeder.solve()["V_pu"].min()), 3)
    (10, 0.898)
    """

    def __repr__(self) -> str:
        loads = len({part.name for part in self.load_parts}) + len(self.loads)
        buses = [bus for bus in self.buses if not is_behind(bus.name)]
        counted = {"buses": buses, "switches": self.switches, "inverters": self.inverters}
        counts = ", ".join(f"{what} {len(rows)}" for what, rows in counted.items())
        if returning := sum(bool(row.neutral) for row in self.inverters):
            counts += f" ({returning} to a neutral)"
        return f"<Feeder {self.name}: {counts}, loads {loads}>"

    @classmethod
    def read(
        cls,
        name: str | Path,
        load_set: str | None = None,
        f_nom: float | None = None,
        *,
        leave_out: Names = (),
        switches: Names = (),
    ) -> Feeder:
        """Return a feeder by the name of a shipped one, or from a folder of tables, or from a file of another program.

        Other programs are OpenDSS (.dss, extra `opendss`), GridLAB-D (.glm with its controls at rest, extra
        `gridlabd`), and those with a reader of your own. A `gridpeers.plant.tables.FeederError` lists every problem.

        Parameters
        ----------
        name : str or Path
            Name of a shipped feeder, path of a folder of tables, or path of a file.
        load_set : str, optional
            Load set of a folder of tables; "main" by default.
        f_nom : float, optional
            Nominal frequency (Hz) of a file; by default the file has it.
        leave_out : list of str
            Elements of a file to leave out, as `Class.name`, with `*` for any: "PVSystem.*".
        switches : list of str
            Lines of a file that become switches.
        """
        if is_foreign(name):
            if load_set is not None:
                raise InputError(f"load_set is for a folder of tables; {name} has one set of loads")
            read = READERS.resolve(_ending(name))
            tables = read(name, f_nom, leave_out=_listed(leave_out), switches=_listed(switches))
        else:
            from gridpeers.plant.tables import read_feeder

            if leave_out or switches or f_nom is not None:
                raise InputError(
                    "switches, leave_out and f_nom are for .dss and .glm files; a folder's tables can be edited"
                )
            tables = read_feeder(str(name), load_set or "main")
        return cls(**{name: getattr(tables, name) for name in tables.__struct_fields__})

    from_opendss = from_glm = read  # names of scripts written before `read` took such files

    def add_inverter(
        self,
        name: str,
        bus: str,
        kind: Literal["GFM", "GFL"],
        P_rated: float,
        *,
        phases: Literal["ABC", "A", "B", "C"] = "ABC",
        neutral: str | int = "",
        microgrid: str = "MG1",
        m_p: float = 0.01,
        m_q: float = 0.05,
        params: str = "",
    ) -> Feeder:
        """Return the feeder with one more inverter; a ValueError says why the bus cannot have it.

        The bus must have the phases, without another inverter on them. A scenario changes further parameters in
        `[plant.inverter.NAME]`.

        Parameters
        ----------
        P_rated : float
            Rating (W), of all phases together.
        neutral : str or int
            Node to which the phases return, by its number or letter, or "earth". By default the neutral of the loads
            at the bus, else earth.
        m_p : float
            P-f droop (pu frequency per pu power).
        m_q : float
            Q-V droop (pu voltage per pu reactive power).
        params : str
            Name of a published set of parameters, such as "regfm_a1".
        """
        from gridpeers.plant.tables.shunts import problems_of

        bus = str(bus)  # many buses have a number as their name
        found = {one.name: one for one in self.buses}.get(bus)
        if found is None:
            raise ValueError(f'bus "{bus}": no such bus; {suggestion(bus, [one.name for one in self.buses], "buses")}')
        row = InverterRow(
            name=name,
            kind=kind,
            bus=bus,
            microgrid=microgrid,
            P_rated=P_rated,
            V_nom=found.V_nom,
            m_p=m_p,
            m_q=m_q,
            phases=str(phases).strip() or "ABC",  # type: ignore[arg-type]  # `problems_of` refuses others
            parameters=params,
            neutral=NODES[neutral - 1] if isinstance(neutral, int) and 0 < neutral <= len(NODES) else str(neutral),
        )
        if problems := problems_of(row, found, self):
            raise ValueError("; ".join(problems))
        row = replace(
            row,
            **{key: str(getattr(row, key)) for key in ("name", "microgrid")},
            **{key: float(getattr(row, key)) for key in ("P_rated", "m_p", "m_q")},  # of numpy, maybe
            neutral=neutral_for(row.neutral, found, row.phases, neutrals_of(self).get(bus, "")),
        )
        return replace(self, inverters=(*self.inverters, row))

    def solve(self, open_switches: Names = ()) -> pd.DataFrame:
        """Return the voltages with the substation as the only source: bus, phase, V (V), V_pu, angle_deg, to.

        A part that the substation does not reach has 0 V. Phases A, B and C count from the neutral of the bus, whose
        letter is in `to`. Other nodes, and phases without a neutral, count from earth, and `to` is empty. Raise
        ValueError without a substation or for an unknown switch, ArithmeticError if the feeder cannot carry its loads.
        """
        import numpy as np
        import pandas as pd

        from gridpeers.plant.network import Network, solve_power_flow

        network = Network(self)
        closed = network.closed0 - {network.switch_name(name) for name in _listed(open_switches)}
        V = solve_power_flow(network, closed)
        buses, phases = zip(*network.nodes, strict=True)
        of = [network.neutrals.get(bus, "") for bus in buses]
        to = [n if p in PHASES and p != n else "" for n, p in zip(of, phases, strict=True)]
        back = np.array([network.index(bus, n) if n else -1 for n, bus in zip(to, buses, strict=True)])
        V = np.where((back >= 0) & (V != 0.0), V - V[back], V)
        values = {"V": np.abs(V), "V_pu": np.abs(V) / network.V_nom, "angle_deg": np.degrees(np.angle(V))}
        return pd.DataFrame({"bus": buses, "phase": phases, **values, "to": to})

    def plot(self, *, voltages: bool = False) -> Figure:
        """Return a one-line diagram, coloured by microgrid, or by the voltage of each bus's lowest energised phase."""
        from gridpeers.scenarios.results.plots.feeder_diagram import feeder_diagram

        V: Any = None
        if voltages:
            table = self.solve()
            live = table[table["phase"].isin(list("ABC")) & (table["V"] > 0.0)]
            V = dict.fromkeys(table["bus"], 0.0) | live.groupby("bus")["V_pu"].min().to_dict()
        return feeder_diagram(self, V)

    def save(self, folder: str | Path) -> Path:
        """Write the tables into a folder and return its path; `plant.feeder` of a scenario names such a folder."""
        from gridpeers.plant.tables.write import write_feeder

        write_feeder(self, Path(folder))
        return Path(folder)


def is_foreign(name: str | Path) -> bool:
    """Return True for a file of another program; the end of its name decides."""
    return _ending(name) in READERS.names


def _ending(name: str | Path) -> str:
    return Path(name).suffix.lower().removeprefix(".")


def _listed(names: Names) -> Names:
    return [names] if isinstance(names, str) else names
