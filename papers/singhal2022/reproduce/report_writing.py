"""The report's files: report.html, report.md with its figures, metrics.json."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

from gridpeers.output_folders import set_status, write_whole
from papers.singhal2022.reproduce.found import Reproduction, metrics_json
from papers.singhal2022.reproduce.markdown import markdown
from papers.singhal2022.reproduce.report_page import html
from papers.singhal2022.reproduce.settings import settings
from papers.singhal2022.reproduce.work import FORMATS, Work


def write(whole: Reproduction, work: Work, folder: Path) -> None:
    """Write all files of a reproduction.

    Parameters
    ----------
    whole : Reproduction
        What came of it.
    work : Work
        The runs, for the scenarios they had.
    folder : Path
        The report's folder.
    """
    (folder / "figures").mkdir()
    results = []
    for result in whole.results:
        figures = {}
        for picture, path in result.figures.items():
            for kind in FORMATS:
                shutil.copyfile(path.with_suffix(f".{kind}"), folder / "figures" / f"{picture.key}.{kind}")
            figures[picture] = folder / "figures" / f"{picture.key}.png"
        results.append(replace(result, figures=figures))
    whole = replace(whole, results=tuple(results))
    ours = settings({part.name: work.spec(part.name) for part in work.parts})
    write_whole(folder / "report.html", html(whole, ours))
    write_whole(folder / "report.md", markdown(whole, ours))
    write_whole(folder / "metrics.json", metrics_json(whole))
    set_status(folder, "complete")
