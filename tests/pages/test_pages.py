"""Every block of the README and of the pages works as it is shown."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.pages.page import PageRun, blocks_of, calls_of, inline_code, parse

ROOT = Path(__file__).parents[2]
PAGES = sorted(str(page.relative_to(ROOT)) for page in (ROOT / "README.md", *ROOT.glob("docs/**/*.md")))


@pytest.fixture
def page_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[PageRun]:
    """A folder, in which Python looks for modules, and in which nothing runs afterwards."""
    folder = tmp_path / "page"
    folder.mkdir()
    monkeypatch.chdir(folder)
    monkeypatch.syspath_prepend(str(folder))
    run = PageRun(folder)
    yield run
    run.end()


@pytest.mark.parametrize("page", PAGES)
def test_a_page_is_shown_as_it_goes(page: str, page_run: PageRun) -> None:
    """Its blocks run in order, or say why they do not; each `gridpeers ...` in a sentence is a command."""
    text = (ROOT / page).read_text(encoding="utf-8")
    comments = re.findall(r"<!-- *(.*?) *-->", text, re.S)
    assert [it for it in comments if not re.match("(skip|exit|file|generated|begin):|end$", it)] == []  # misspelt
    for code in inline_code(text):
        for words in calls_of(code) if code.startswith(("gridpeers ", ".venv/bin/gridpeers ")) else ():
            parse(words, whole=False)

    for block in blocks_of(text):
        page_run.run(block)
