"""Which process speaks for a name. Pure."""

from __future__ import annotations

from collections.abc import Iterator


class Claims:
    """Tokens that are there. Of two processes that claim one name the first counts, until its token is gone.

    Examples
    --------
    >>> claims = Claims()
    >>> claims.appeared("inv2", "a"), claims.appeared("inv2", "b")
    (True, False)
    >>> claims.vanished("inv2", "a"), claims.instance("inv2")
    (True, 'b')
    >>> claims.vanished("inv2", "b"), claims.instance("inv2")
    (True, '')
    """

    def __init__(self) -> None:
        self._instances: dict[str, list[str]] = {}
        """Those of each name, the one that counts first."""

    def appeared(self, name: str, instance: str) -> bool:
        """Note a token; whether it counts."""
        instances = self._instances.setdefault(name, [])
        if instance not in instances:
            instances.append(instance)
        return instances[0] == instance

    def vanished(self, name: str, instance: str) -> bool:
        """Note that a token is gone; whether it counted."""
        counted = self.instance(name) == instance
        instances = self._instances.get(name, [])
        if instance in instances:
            instances.remove(instance)
        if not instances:
            self._instances.pop(name, None)
        return counted

    def instance(self, name: str) -> str:
        """The instance of a name that counts; empty if there is none."""
        return next(iter(self._instances.get(name, ())), "")

    def __iter__(self) -> Iterator[str]:
        return iter(self._instances)
