"""The plant under simulated time in one process with its agents and the recorder: ticks without messages. Pure."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_interface import PlantLike
from gridpeers.plant.plant_stepper import TELEMETRY_TICKS, PlantStepper
from gridpeers.wire.journal import LOT, JournalBuffer, TickTraffic
from gridpeers.wire.messages import PLANT, Journal, Measurement, State, Telemetry
from gridpeers.wire.post import Post


class DirectPlant:
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
        self.stepper = PlantStepper(config, plant)
        self.finished = False
        self._on_telemetry, self._on_journal = on_telemetry, on_journal
        self._post = Post(PLANT, config.run, config.epoch)
        self._traffic: TickTraffic | None = None
        if config.record != "physics":
            self._post.journal = JournalBuffer()
            self._traffic = TickTraffic(self._post.keys, config.agents, self._post.journal)
        self._measured: list[Measurement] = []  # measurements of this tick

    def begin_tick(self) -> list[Measurement]:
        self._measured = list(self.stepper.measurements(self.stepper.config.agents))
        if self.stepper.tick == 0:
            self._report()
        return self._measured

    def end_tick(self, states: Sequence[State]) -> None:
        """Hold the set-points of these states and advance; at the end of the run, or if the plant breaks, be over."""
        stepper = self.stepper
        if self._traffic is not None:
            self._traffic.exchanged(stepper.tick, self._measured, states)
        for state in states:
            if state.fault or state.quiet:
                stepper.hear(state)
        broken = stepper.law_failure()
        if not broken:
            for state in states:
                if not state.idle:
                    stepper.plant.hold(state.sender, state.P_set, state.V_set)
            broken = "" if stepper.advance() else stepper.broken
        if broken:
            stepper.outcome, stepper.reproducible = broken, False
        stepper.collect()
        if broken or stepper.at_end:
            self._hand_over_journal(0)
            self._report(final=True)
            self.finished = True
        elif stepper.tick % TELEMETRY_TICKS == 0:
            self._report()
            self._hand_over_journal(LOT)

    def _report(self, *, final: bool = False) -> None:
        for message in self.stepper.report(final=final):
            self._on_telemetry(message)

    def _hand_over_journal(self, least: int) -> None:
        """Hand the journal over if it has so many bytes: `LOT` takes milliseconds, so a kill takes no more of them."""
        if self._post.journal is not None and len(self._post.journal) >= least:
            for part in self._post.take_journal(self.stepper.t):
                self._on_journal(part)
