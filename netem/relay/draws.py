"""Random numbers that depend on what they are drawn for, not on when: so runs repeat."""

from __future__ import annotations

from hashlib import blake2b


class Draws:
    """Uniform numbers of one connection and direction.

    Parameters
    ----------
    seed : int
        Seed of the relay.
    way : str
        Which connection and direction, e.g. "2/back".

    Examples
    --------
    >>> Draws(1, "1/there").uniform("loss", 7) == Draws(1, "1/there").uniform("loss", 7)
    True
    >>> Draws(1, "1/there").uniform("loss", 7) == Draws(1, "1/there").uniform("loss", 8)
    False
    """

    def __init__(self, seed: int, way: str) -> None:
        self._stem = f"{seed}/{way}/"

    def uniform(self, what: str, number: int, turn: int = 1) -> float:
        """Number from 0 to 1 (1 excluded) for one packet.

        Parameters
        ----------
        what : str
            What is decided by it.
        number : int
            Number of the packet.
        turn : int, optional
            Which of its transmissions.
        """
        digest = blake2b(f"{self._stem}{what}/{number}/{turn}".encode(), digest_size=8).digest()
        return (int.from_bytes(digest, "big") >> 11) * 2.0**-53
