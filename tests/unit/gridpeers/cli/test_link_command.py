"""Mistakes in the words of `gridpeers link` are told in one line, before anything is sent."""

from __future__ import annotations

import pytest

from tests.command_line import invoke


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["set", "inv1", "inv4"], "nothing is to be set; give one of --delay, --jitter (with --delay), --loss,"),
        (["set", "inv1 -> inv4", "--loss", "20"], "--loss: a loss is a probability from 0 to 1, got 20; did you"),
        (["set", "inv1", "inv4", "--delay", "100"], "--delay: 100 s is not plausible for a delay (0 to 10 s); did"),
        (["set", "inv1", "inv4", "--delay", "0.1", "--jitter", "0.2"], "--jitter: must be above 0 s, and at most"),
        (["set", "inv1", "inv4", "--jitter", "0.2"], "--jitter: is around a delay; give --delay too"),
        (["set", "inv1", "inv4", "--profile", "lt"], '--profile: there is no profile "lt"; did you mean "lte"?'),
        (["set", "inv1", "inv4", "--loss", "0.1", "--for", "-1"], "--for: a time of the run must be above 0, got -1 s"),
        (["cut", "plant", "plant"], 'LINKS: "plant <-> plant" matches nothing: both ends are plant alone'),
        (["cut", "inv1"], 'LINKS: "inv1" names no links; write "inv4 <-> inv7"'),
        (["cut", "inv1", "inv4", "inv7"], 'LINKS: "inv1 inv4 inv7" is neither two names nor one pattern'),
        (["heal", "inv1", "-"], 'LINKS: the shell took the arrow for a redirection; put the pattern in quotes'),
    ],
)  # fmt: skip
def test_what_cannot_be_meant_is_told_before_a_run_is_sought(words: list[str], said: str) -> None:
    """Exit code 2, under the option that was typed, with what would be right."""
    code, text = invoke("link", *words)

    assert code == 2
    assert said in text
