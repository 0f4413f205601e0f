"""A plant that can be solved by hand: linear droop, one frequency per island, no network.

For the tests of everything around the plant: it starts at once and needs no numpy. Run as a script it is a plant
process, like ``python -m gridpeers.plant``. From t = 0.1 s on it is an island.
"""

from __future__ import annotations

from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_interface import Reading, RecordedPlant
from gridpeers.plant.plant_process import run_plant
from gridpeers.scenarios.emulation.emulated_links import links_of
from gridpeers.wire.driver.process import main
from gridpeers.wire.messages import LoadSetting, PlantEvent

M_P, F_NOM, V_NOM, P_RATED, LOAD = 0.01, 60.0, 277.0, 100e3, 0.8
"""Droop (pu), nominal frequency (Hz) and voltage (V), rating (W), load per inverter in the island (pu)."""

ISLANDING = 0.1  # Time (s) at which the grid is lost


class ToyPlant(RecordedPlant):
    """Equal inverters on one bus: e = m_p (mean P_set - load), p = P_set - e/m_p, q = 20 (V_set - mean V_set), pu."""

    def __init__(self, config: PlantConfig) -> None:
        self.inverters = tuple(f"inv{i}" for i in range(1, int(config.settings.feeder.removeprefix("toy")) + 1))
        self._config = config
        self._members = len(self.inverters) - len(config.settings.spares)
        self._P_set = dict.fromkeys(self.inverters, config.settings.P_set0)
        self._V_set = {name: 1.0 + 0.001 * i for i, name in enumerate(self.inverters)}
        self._off = set(config.settings.spares)
        self._tick, self._stands = 0, "close"
        self._rows: list[tuple[float, ...]] = [self._row()]
        self._events: list[PlantEvent] = []
        self._loads: dict[str, complex] = {}

    def measure(self) -> dict[str, Reading]:
        on = [name for name in self.inverters if name not in self._off]
        mean = sum(self._P_set[name] for name in on) / max(1, len(on))
        V_mean = sum(self._V_set[name] for name in on) / max(1, len(on))
        islanded = self._t >= ISLANDING
        load = LOAD * self._members / max(1, len(on))
        surplus = mean - load if islanded else 0.0
        return {
            name: Reading(
                P=(self._P_set[name] - surplus) * P_RATED if name in on else 0.0,
                Q=20.0 * (self._V_set[name] - V_mean) * P_RATED if name in on else 0.0,
                V=V_mean * V_NOM,
                f=F_NOM * (1.0 + M_P * surplus),
                P_set=self._P_set[name] * P_RATED,
                V_set=self._V_set[name] * V_NOM,
                grid_connected=not islanded,
                island=self.inverters[0] if islanded else "grid",
            )
            for name in self.inverters
        }

    def hold(self, name: str, P_set: float, V_set: float) -> None:
        self._P_set[name], self._V_set[name] = P_set / P_RATED, V_set / V_NOM

    def advance(self) -> None:
        """Go one control period on; started with P_set0 above 1 pu it has no solution as an island."""
        if self._config.settings.P_set0 > 1.0 and self._t >= ISLANDING:
            raise RuntimeError(f"no solution at t = {self._t:g} s: P_set0 is {self._config.settings.P_set0:g} pu")
        self._tick += 1
        if abs(self._t - ISLANDING) < 1e-9:
            self._events.append(PlantEvent(t=self._t, kind="switch", subject="toy", text="the grid is lost"))
        self._rows.append(self._row())

    @property
    def switches(self) -> dict[str, bool]:
        return {"sw1": self._stands == "close"}

    def switch(self, name: str, action: str, *, synchronised: bool = False) -> bool:
        """Operate the only switch there is; it does nothing but tell, and stands as it was told last."""
        if name != "sw1":
            raise ValueError(f'no switch "{name}"; switches are sw1')
        self._events.append(PlantEvent(t=self._t, kind="switch", subject=name, text=f"{name}: {action}"))
        self._stands, before = action, self._stands
        return action == before

    @property
    def loads(self) -> dict[str, complex]:
        return self._loads

    def set_load(self, name: str, setting: LoadSetting) -> str:
        """Set the only load there is, which does nothing but tell."""
        if name != "load1":
            raise ValueError(f'no load "{name}"; loads are load1')
        self._loads[name] = complex(setting.P or 0.0, setting.Q or 0.0)
        self._events.append(PlantEvent(t=self._t, kind="load", subject=name, text=f"{name} set"))
        return f"{name}: {self._loads[name]:g} VA"

    def connect(self, name: str, on: bool) -> None:
        """Put an inverter on the bus or take it off; off, it takes no part in the droops."""
        if on == (name in self._off):
            (self._off.discard if on else self._off.add)(name)
            text = f"{name} {'connected' if on else 'disconnected'}"
            self._events.append(PlantEvent(t=self._t, kind="inverter", subject=name, text=text))

    def close(self) -> None:
        """Nothing of it is elsewhere."""

    @property
    def _t(self) -> float:
        return round(self._tick * self._config.T_c, 9)

    def _row(self) -> tuple[float, ...]:
        readings = self.measure().values()
        return (self._t, *(x for r in readings for x in (r.f, r.P, r.Q, r.V, r.P_set, r.V_set)))


if __name__ == "__main__":
    main("toy_plant", PlantConfig, lambda config: run_plant(config, ToyPlant, links_of))
