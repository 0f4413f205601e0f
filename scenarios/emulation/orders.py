"""An order of a person to the links of a running run, as it travels."""

from __future__ import annotations

import msgspec

from netem.spec.change import Change, Heal
from netem.spec.fault import Fault


class Order(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """Either a fault or its end."""

    fault: Fault | None = None
    """What links shall do."""
    heal: Heal | None = None
    """On which links what holds shall end."""

    @property
    def change(self) -> Change:
        """The one of the two that is given."""
        found = self.fault or self.heal
        if found is None or (self.fault and self.heal):
            raise ValueError("an order is either a fault or a heal")
        return found

    def to_text(self) -> str:
        """As it travels."""
        return msgspec.json.encode(self).decode()

    @classmethod
    def of_text(cls, text: str) -> Order:
        """What has come; ValueError if it is no order."""
        try:
            order = msgspec.json.decode(text, type=cls)
        except msgspec.DecodeError as error:
            raise ValueError(f"no order to links: {error}") from None
        order.change  # noqa: B018  that it is one of the two
        return order
