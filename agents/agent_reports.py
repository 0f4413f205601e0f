"""An agent sends the plant its journal, and the accounts of the emulated links into it, for the record. Pure."""

from __future__ import annotations

from gridpeers.agents.hearing import Hearing
from gridpeers.wire.post import Post

JOURNAL_PERIOD = 0.2
"""Time (s) between two parts of the journal, in simulated time only with emulated links: a kill loses no more."""


class AgentReports:
    """`instance`: id of the agent's process; `empty`: whether a part of the journal without entries is sent, too."""

    def __init__(self, post: Post, heard: Hearing, instance: str, *, empty: bool) -> None:
        self._post, self._heard, self._instance, self._empty = post, heard, instance, empty
        self._ended = False

    def journal(self, t: float) -> None:
        post = self._post
        post.send(post.keys.journal(post.name), *post.take_journal(t, empty=self._empty))

    def links(self, *, last: bool = False) -> None:
        post, links = self._post, self._heard.links
        post.send(post.keys.report(post.name), *post.take_link_reports(links, instance=self._instance, last=last))

    def last(self, t: float) -> None:
        """Send all that is left at t (s of run time), unless that is done."""
        if not self._ended:
            self._ended = True
            self.journal(t)
            self.links(last=True)
