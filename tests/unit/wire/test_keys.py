from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gridpeers.wire.keys import Keys, check_name, is_token

zenoh = pytest.importorskip("zenoh")


@pytest.mark.parametrize("bad", ["", "a/b", "a*", "a b", "$x", "what?", "#1", "@x", "ä", "x" * 65])
def test_names_that_zenoh_would_refuse_or_hide_are_refused(bad: str) -> None:
    """The error names the field, the value and what would be right."""
    with pytest.raises(ValueError, match=r"run: .* cannot be part of a Zenoh key; use 1 to 64 letters"):
        Keys(bad)


@given(st.from_regex(r"[A-Za-z0-9_.-]{1,64}", fullmatch=True))
def test_every_name_that_is_accepted_makes_a_key(name: str) -> None:
    """Zenoh takes what we take."""
    check_name("run", name)

    zenoh.KeyExpr(Keys(name).state(name))


def test_tokens_are_told_from_texts_that_somebody_has_made_up() -> None:
    """The longest names make tokens; what no process of a run holds is none."""
    keys = Keys("d" * 64)
    tokens = keys.alive_plant(1), keys.alive_agent("n" * 64, "a" * 64), keys.alive_recorder("r" * 64)
    made_up = f"{tokens[0]}/{'x' * 65}", f"{tokens[1]}/more", f"{tokens[2]}/", "x/" * 1_000

    assert [*map(is_token, tokens), *map(is_token, made_up)] == [True] * 3 + [False] * 4


def test_parts_are_those_of_the_own_run_only() -> None:
    """A key of another run, even of one whose name begins alike, has no parts."""
    assert Keys("demo").parts(Keys("demo").state("inv1")) == ("state", "inv1")
    assert Keys("demo").parts(Keys("demo2").state("inv1")) == ()
