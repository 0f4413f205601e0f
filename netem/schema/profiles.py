"""Profiles of real links by name, each with its source, or the plain word that it is assumed.

A profile is a starting point, not a measurement of a network: a number that is not from physics, a standard or a
published requirement is marked as assumed. Delays are one way, for messages of some 100 bytes.
"""

from __future__ import annotations

import msgspec

from netem.models.delay import AnyDelay, Constant, Lognormal, Normal, Uniform
from netem.models.loss import AnyLoss, Bernoulli, GilbertElliott
from netem.models.medium import Rate, Slots


class Profile(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Faults of a kind of link."""

    title: str
    """A few words."""
    source: str
    """Where each number comes from."""
    delay: AnyDelay | None = None
    """Its delay."""
    loss: AnyLoss | None = None
    """Its loss."""
    rate: Rate | None = None
    """Its rate."""
    slots: Slots | None = None
    """Its slots."""


PROFILES: dict[str, Profile] = {
    "fibre": Profile(
        title="optical fibre within a town",
        source="5 us/km (refractive index 1.47) over 20 km are 0.1 ms; two switches, 0.1 ms, and loss 1e-6: assumed",
        delay=Constant(delay_s=0.0002),
        loss=Bernoulli(p=1e-6),
    ),
    "wifi-mesh": Profile(
        title="Wi-Fi mesh of about three hops",
        source="assumed throughout: some ms a hop by contention, a tail by retries, short bursts of loss",
        delay=Lognormal(offset_s=0.001, median_s=0.006, sigma=0.7),
        loss=GilbertElliott(p=0.01, r=0.4),
    ),
    "lte": Profile(
        title="LTE through a public network",
        source="assumed throughout: half of a round trip of 50 ms with a tail of schedulers and handovers, alike from "
        "one message to the next; losses are rare, as the radio link repeats",
        delay=Lognormal(offset_s=0.01, median_s=0.015, sigma=0.4, correlation=0.5),
        loss=GilbertElliott(p=0.0005, r=0.25),
    ),
    "plc": Profile(
        title="narrow-band power-line carrier",
        source="rate of the order of those of PRIME and G3-PLC (ITU-T G.9904, G.9903: tens of kbit/s); slots, delay "
        "and bursts of loss (noise in step with the mains) assumed",
        delay=Uniform(low_s=0.005, high_s=0.02),
        loss=GilbertElliott(p=0.02, r=0.2),
        rate=Rate(bytes_per_s=4000.0, queue_bytes=2000),
        slots=Slots(period_s=0.1, length_s=0.05),
    ),
    "lora-like": Profile(
        title="long-range radio of very low rate",
        source="684 bytes/s is 5470 bit/s, LoRa SF7 at 125 kHz (LoRaWAN Regional Parameters); queue, delay and loss "
        "assumed; the legal duty cycle of 1 % is not modelled",
        delay=Normal(mean_s=0.05, std_s=0.01),
        loss=Bernoulli(p=0.05),
        rate=Rate(bytes_per_s=684.0, queue_bytes=500),
    ),
    "geo-satellite": Profile(
        title="geostationary satellite, one hop",
        source="up and down 35 786 km at the speed of light are 0.239 s, at the rim of the footprint (41 679 km) "
        "0.278 s; 260 ms is between them; jitter and loss assumed",
        delay=Normal(mean_s=0.26, std_s=0.01, fifo=True),
        loss=Bernoulli(p=0.001),
    ),
    "der-requirement": Profile(
        title="the worst that distributed energy resources should have to bear",
        source="300 ms single trip and 1 % loss: the criteria for distributed PV of Zhang et al. (NREL), Energies 11 "
        "(2018), abstract; its rate of 9.6 kbit/s is left out, as it carries no 50 states a second",
        delay=Constant(delay_s=0.3),
        loss=Bernoulli(p=0.01),
    ),
}
"""The profiles by name."""
