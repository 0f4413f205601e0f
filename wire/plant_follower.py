"""Which plant an agent or a recorder believes, of those that claim to be the plant of its run. Pure."""

from __future__ import annotations

from math import inf

from wire.keys import epoch_of
from wire.messages import PLANT, AnyMessage
from wire.node import Node, Route


class PlantFollower(Node):
    """Follows the plant that speaks first of those whose tokens are there, until its token is gone.

    Parameters
    ----------
    name : str
        Who it is.
    run : str
        Name of the run.
    rate : float, optional
        Most messages of one sender per s of run time; see `wire.admission`.
    """

    def __init__(self, name: str, run: str, rate: float = inf) -> None:
        super().__init__(name, run, rate)
        self._plants: set[int] = set()
        """Epochs of the plants whose tokens are there."""

    def _plant_appeared(self, part: str) -> bool:
        """Note the token of a plant by its last part; False if no plant could hold such a one."""
        epoch = epoch_of(part)
        if epoch is not None:
            self._plants.add(epoch)
        return epoch is not None

    def _plant_vanished(self, part: str) -> bool:
        """Note that the token of a plant is gone; whether the endpoint is without a plant now."""
        if (epoch := epoch_of(part)) not in self._plants:
            return False
        self._plants.discard(epoch)
        followed = self.admission.epoch(PLANT)
        if followed == epoch:
            self.admission.release(PLANT)
        return followed == epoch or not self._plants

    def _admit(self, route: Route, message: AnyMessage, now: float) -> None:
        """Follow a plant that is there, if none is followed yet, and check the message."""
        epoch = message.epoch
        if route.sender == PLANT == message.sender and epoch in self._plants and self.admission.epoch(PLANT) is None:
            self.admission.bind(PLANT, epoch)
            self._follow(epoch)
        super()._admit(route, message, now)

    def _follow(self, epoch: int) -> None:
        """Note that the plant of this epoch is followed from now on."""
