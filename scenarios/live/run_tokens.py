"""Tokens of a run and of the runs beside it, each kind with its bound. Pure."""

from __future__ import annotations

from gridpeers.wire.bounds import MOST_INVERTERS
from gridpeers.wire.keys import Keys, epoch_of, run_of_plant
from gridpeers.wire.membership import MOST_PROCESSES
from gridpeers.wire.plant_follower import MOST_PLANTS


class RunTokens:
    """The tokens that are there, as far as there is room for them."""

    def __init__(self, run: str) -> None:
        self._run, self._keys = run, Keys(run)
        self.epochs: set[int] = set()
        """Epochs of the plants of the run."""
        self.agents: dict[str, set[str]] = {}
        """Instances of each agent of the run."""
        self._others: set[str] = set()
        """Tokens of the plants of other runs."""
        self._noted: set[str] = set()
        """All tokens that are noted."""

    @property
    def runs(self) -> set[str]:
        """Names of the runs whose plants are there, this one included."""
        runs = set(map(run_of_plant, self._others))
        return runs | {self._run} if self.epochs else runs

    def is_noted(self, key: str) -> bool:
        """Whether a token is noted, so that its end must be known: `gridpeers.wire.backlog`. From any thread."""
        return key in self._noted

    def appeared(self, key: str) -> None:
        """Note a token, if it is one of those and there is room for it."""
        match self._keys.parts(key):
            case ("alive", "plant", part) if (epoch := epoch_of(part)) is not None and len(self.epochs) < MOST_PLANTS:
                self.epochs.add(epoch)
            case ("alive", "agent", name, instance) if self._has_room(name):
                self.agents.setdefault(name, set()).add(instance)
            case () if run_of_plant(key) and len(self._others) < MOST_PLANTS:
                self._others.add(key)
            case _:
                return
        self._noted.add(key)

    def vanished(self, key: str) -> None:
        """Note that a token is gone."""
        if key not in self._noted:
            return
        self._noted.discard(key)
        match self._keys.parts(key):
            case ("alive", "plant", part):
                self.epochs.discard(int(part))
            case ("alive", "agent", name, instance):
                self.agents[name].discard(instance)
                if not self.agents[name]:
                    del self.agents[name]
            case _:
                self._others.discard(key)

    def _has_room(self, name: str) -> bool:
        instances = self.agents.get(name)
        return len(self.agents) < MOST_INVERTERS if instances is None else len(instances) < MOST_PROCESSES
