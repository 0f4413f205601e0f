"""What a person is told of the lines that a plant prints."""

from __future__ import annotations

from gridpeers.plant.start_words import COMPILING, LISTENING
from gridpeers.scenarios.live.live_processes import limited, meaning
from gridpeers.wire.rate_limit import BURST, RateLimit
from tests.toy.toy_configs import toy_configs


def test_a_refused_handshake_is_told_without_the_words_of_zenoh() -> None:
    """Its reason stays; colours of a terminal, thread and hint go."""
    config, _ = toy_configs(2)
    line = (
        "\x1b[2m2026-11-23T09:08:43.534631Z\x1b[0m \x1b[33m WARN\x1b[0m app-0 ThreadId(02) "
        "\x1b[2mzenoh_link_tls::unicast\x1b[0m\x1b[2m:\x1b[0m peer sent no certificates. "
        "Hint: increase the system open file limit."
    )

    assert meaning(line, config) == "a link was refused: peer sent no certificates"
    assert meaning(LISTENING, config) == ""
    assert "is being built" in meaning(COMPILING, config)


def test_an_agent_with_an_expired_certificate_does_not_flood_the_terminal() -> None:
    """It tries again for ever, some times a second: after the first refusals, one in ten seconds is told."""
    config, _ = toy_configs(2)
    limit = RateLimit()
    line = (
        "WARN app-0 zenoh_link_tls::unicast: invalid peer certificate: certificate expired: verification time {} (UNIX)"
    )

    told = [limited(meaning(line.format(1795480184 + k), config), limit, 0.5 * k) for k in range(7200)]

    assert (
        told[0]
        == "a link was refused: invalid peer certificate: certificate expired: verification time 1795480184 (UNIX)"
    )
    assert len([text for text in told if text]) <= BURST + 360
