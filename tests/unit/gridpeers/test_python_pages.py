"""What the README and docs/python.md show of a Python session is what comes of it."""

from __future__ import annotations

import doctest
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
PAGES = ("README.md", "docs/python.md")


@pytest.mark.parametrize("page", PAGES)
def test_a_session_is_shown_as_it_goes(page: str) -> None:
    """Every line that is typed gives what stands below it."""
    text = (ROOT / page).read_text(encoding="utf-8")
    blocks = "\n".join(re.findall(r"```pycon\n(.*?)```", text, re.S))
    flags = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
    test = doctest.DocTestParser().get_doctest(blocks, {}, page, page, 0)
    said: list[str] = []

    failed, tried = doctest.DocTestRunner(optionflags=flags).run(test, out=said.append)

    assert tried >= 7
    assert failed == 0, "".join(said)
