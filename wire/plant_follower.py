"""Select the plant that an agent or a recorder follows, among those that claim to be its run's. Pure."""

from __future__ import annotations

from math import inf

from gridpeers.wire.backlog import is_marked
from gridpeers.wire.keys import epoch_of
from gridpeers.wire.messages import PLANT, AnyMessage
from gridpeers.wire.node import Node, Route

MOST_PLANTS = 64
"""Plants of one run that may hold tokens: two, while one replaces another; those that a recorder has outlived; some
that are mistaken."""


class PlantFollower(Node):
    """Follow the present plant that sends first, until its token is gone."""

    def __init__(self, name: str, run: str, rate: float = inf) -> None:
        super().__init__(name, run, rate)
        self._plants: set[int] = set()
        """Epochs of the present plants."""

    def _plant_appeared(self, part: str) -> bool:
        """Note a plant's token by its last part; return False if that is no epoch, or one of too many."""
        epoch = epoch_of(part)
        if epoch is None:
            return False
        if len(self._plants) >= MOST_PLANTS and epoch not in self._plants:
            text = f"the token of one more plant; {MOST_PLANTS} hold tokens"
            self.rejects.add("excess", self.keys.alive_plant(epoch), text)
            return False
        self._plants.add(epoch)
        return True

    def _plant_vanished(self, part: str) -> bool:
        """Note that a plant's token is gone; return whether this node has no plant now."""
        if (epoch := epoch_of(part)) not in self._plants:
            return False
        self._plants.discard(epoch)
        followed = self.admission.epoch(PLANT)
        if followed == epoch:
            self.admission.release(PLANT)
        return followed == epoch or not self._plants

    def is_noted(self, key: str) -> bool:
        """Whether the holder of a token is noted, be it a plant that is not followed."""
        match self.keys.parts(key):
            case ("alive", "plant", part):
                return epoch_of(part) in self._plants
        return super().is_noted(key)

    def is_known(self, key: str, payload: bytes) -> bool:
        """Whether a message looks like one of the sender of its key, be it a plant that is not followed yet."""
        route = self.routes.get(key)
        of_plant = route is not None and route.sender == PLANT
        return super().is_known(key, payload) or (
            of_plant and any(is_marked(payload, PLANT, epoch) for epoch in tuple(self._plants))
        )

    def _admit(self, route: Route, message: AnyMessage, now: float) -> None:
        """Check a message; first follow its plant if this node follows none."""
        epoch = message.epoch
        if route.sender == PLANT == message.sender and epoch in self._plants and self.admission.epoch(PLANT) is None:
            self._check_certificate(PLANT)
            self.admission.bind(PLANT, epoch)
            self._follow(epoch)
        super()._admit(route, message, now)

    def _follow(self, epoch: int) -> None:
        """Note the epoch of the plant that this node follows from now on."""
