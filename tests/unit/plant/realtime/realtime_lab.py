"""The plant in real time over the toy plant, on a fake clock; the test plays the agents."""

from __future__ import annotations

from typing import Any

from msgspec.structs import replace

from gridpeers.wire.messages import Answer, Command, Leave
from tests.toy.toy_configs import toy_configs
from tests.unit.plant.plant_lab import KEYS, PlantLab

T_C = 0.02


class Lab(PlantLab):
    """The toy plant in real time."""

    def __init__(self, n: int = 3, *, spares: tuple[str, ...] = (), **changes: Any) -> None:
        config, _ = toy_configs(n, end=2.0)
        settings = replace(config.settings, spares=spares)
        agents = tuple(name for name in config.agents if name not in spares)
        super().__init__(
            replace(config, **{"clock": "realtime", "settings": settings, "agents": agents} | changes), 50.0
        )

    def leave(self, name: str, epoch: int = 1) -> None:
        self.hear(KEYS.leave(name), Leave(sender=name, epoch=epoch, seq=0, t=0.0))

    def ask(self, verb: Any, argument: str | dict[str, Any] = "", **further: Any) -> Answer:
        """Send a command with a name, or with a command to links."""
        content = {"argument": argument} if isinstance(argument, str) else {"link_command": argument}
        command = Command(sender="cli", epoch=1, seq=7, t=0.0, verb=verb, reply_to="z1", **content, **further)
        self.hear(KEYS.command, command)
        key, answer = next((key, m) for key, m in reversed(self.sent) if isinstance(m, Answer))
        assert (key, answer.seq) == (KEYS.answer("z1"), 7)
        return answer

    def step(self, count: int = 1, delay: float = 0.0) -> None:
        """Make steps, each so late (s)."""
        for _ in range(count):
            due = self.node.deadline
            assert due is not None
            self.now = max(self.now, due + delay)  # in a rush after a late step, the next is due already
            self.node.expire(self.now)
            self.do()


def running(n: int = 3, **changes: Any) -> Lab:
    lab = Lab(n, **changes)
    lab.join(*lab.node.config.agents)
    assert lab.node.phase == "running"
    return lab
