"""The members of a site: everybody who holds a certificate, with a role. Pure.

A certificate's common name is ``role:name``, e.g. ``agent:inv4``, because Zenoh's access control knows a process by its
common name alone. A name whose certificate was revoked gets its next one in the next *generation*, ``agent:inv4:2``:
else the revoked certificate would count again.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal, get_args

import msgspec

Role = Literal["plant", "agent", "operator", "viewer"]
"""The part that a process may take in a run. A command line, a page and a recorder are operators or viewers."""

ROLES: tuple[Role, ...] = get_args(Role)

DATE_AND_TIME = "%Y-%m-%d %H:%M UTC"
"""Form of the time at which a certificate ends: it may live for hours."""

LONGEST_COMMON_NAME = 64
"""Characters of a common name (X.520, ub-common-name)."""


class Member(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One name of the site."""

    name: str
    """Name; of an agent that of its inverter."""
    role: Role
    """What it may do."""
    generation: int = 1
    """Number of the certificate: how many of this name have been revoked before, and one."""
    revoked: bool = False
    """Whether the certificate of this generation was revoked."""
    expires: str = ""
    """When the certificate ends, to the minute, e.g. "2027-11-23 12:00 UTC"; empty if none was issued. Lists of old
    sites have the day alone."""

    @property
    def common_name(self) -> str:
        """Common name of its certificate.

        Examples
        --------
        >>> Member(name="inv4", role="agent").common_name, Member(name="inv4", role="agent", generation=2).common_name
        ('agent:inv4', 'agent:inv4:2')
        """
        return self._in_generation(self.generation)

    @property
    def accepted(self) -> tuple[str, ...]:
        """Common names under which others accept it, without the revoked one.

        The next generation is among them: it exists only once the site has issued it, and so a name that gets a new
        certificate can take part in a run that has begun before.

        Examples
        --------
        >>> Member(name="inv4", role="agent", revoked=True).accepted
        ('agent:inv4:2',)
        """
        following = self._in_generation(self.generation + 1)
        return (following,) if self.revoked else (self.common_name, following)

    def _in_generation(self, number: int) -> str:
        return f"{self.role}:{self.name}" if number == 1 else f"{self.role}:{self.name}:{number}"


def with_inverters(members: Iterable[Member], inverters: Iterable[str]) -> tuple[Member, ...]:
    """Return the members, and an agent for each inverter that is not among them.

    The site may issue its certificate during the run: until then nobody can be it.

    Examples
    --------
    >>> [member.common_name for member in with_inverters((Member(name="inv1", role="agent"),), ("inv1", "inv10"))]
    ['agent:inv1', 'agent:inv10']
    """
    known = tuple(members)
    names = {member.name for member in known}
    return (*known, *(Member(name=name, role="agent") for name in dict.fromkeys(inverters) if name not in names))
