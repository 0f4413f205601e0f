"""The plant under simulated time in one process with its agents and the recorder: ticks without messages. Pure."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from gridpeers.plant.lockstep_plant import LockstepPlant
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_interface import PlantLike
from gridpeers.wire.journal import LOT
from gridpeers.wire.messages import Journal, Measurement, State, Telemetry


class DirectPlant(LockstepPlant):
    """A plant without schedule and emulated links, whose agents all take part to the end."""

    def __init__(
        self,
        config: PlantConfig,
        plant: PlantLike,
        on_telemetry: Callable[[Telemetry], None],
        on_journal: Callable[[Journal], None],
    ) -> None:
        assert not config.schedule
        assert not config.links
        super().__init__(config, plant)
        self._on_telemetry, self._on_own_journal = on_telemetry, on_journal
        self._measured: list[Measurement] = []  # measurements of this tick
        self._roster, self.phase = config.agents, "ticking"
        self._reporter.collect()

    def begin_tick(self) -> list[Measurement]:
        measurements = list(self._measurements())
        if self.tick == 0:
            self._report(final=False)
        self._measured = measurements
        return measurements

    def end_tick(self, states: Sequence[State]) -> None:
        """Hold the set-points of these states and advance; at the end of the run, or if the plant breaks, be over."""
        if self._tick_traffic is not None:
            self._tick_traffic.exchanged(self.tick, self._measured, states)
        for state in states:
            self._note_state(state)
            if not state.idle:
                self._states[state.sender] = state
        self._finish_tick(0.0)

    def _send(self, message: Telemetry) -> None:
        self._on_telemetry(message)

    def _report_journal(self, *, last: bool = False) -> None:
        if self.post.journal is None or self._tick_traffic is None:
            return
        if len(self.post.journal) < LOT and not last:  # some milliseconds of this run: no kill can take more
            return
        for journal in self.post.take_journal(self.t):
            self._on_own_journal(journal)
