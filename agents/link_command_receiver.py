"""Commands to the emulated links into an agent: taken in their sequence, each once, and acknowledged. Pure."""

from __future__ import annotations

from gridpeers.wire.links import Links
from gridpeers.wire.messages import LinkAcknowledgement, LinkRequest
from gridpeers.wire.wording import printable


class LinkCommandReceiver:
    def __init__(self, name: str, epoch: int, links: Links | None) -> None:
        self._name, self._epoch, self._links = name, epoch, links
        self._last = 0

    def restart(self) -> None:
        """Forget all commands: another plant has begun, whose run starts at 0."""
        self._last = 0
        if self._links is not None:
            self._links.restart()

    def take(self, request: LinkRequest, t: float) -> LinkAcknowledgement | None:
        """Carry a command out, or tell the links' status at t (s of run time); None if an earlier one is missing."""
        if self._links is None:
            return self._answer(request, ok=False, text="there are no emulated links to this agent")
        if request.seq == 0:
            return self._answer(request, ok=True, text="", data=self._links.status(t))
        if request.seq > self._last + 1:
            return None
        if request.seq <= self._last:
            return self._answer(request, ok=True, text="done before")
        self._last = request.seq
        try:
            return self._answer(request, ok=True, text=self._links.command(request.link_command, request.t).changed)
        except ValueError as error:
            return self._answer(request, ok=False, text=str(error))

    def _answer(self, request: LinkRequest, *, ok: bool, text: str, data: bytes = b"") -> LinkAcknowledgement:
        return LinkAcknowledgement(
            sender=self._name,
            epoch=self._epoch,
            seq=request.seq,
            t=request.t,
            ok=ok,
            text=printable(text),
            reply_to=request.reply_to,
            data=data,
        )
