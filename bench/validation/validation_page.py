"""The page docs/validation.md: an introduction, and for each part its text, one table and one figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib as mpl

from bench.validation.validation_part import CaseResult, ValidationPart
from gridpeers.figures import PAGE, save

DOCS = Path(__file__).parents[2] / "docs"

PAGE_FILE, FIGURES = "validation.md", "images/validation"

INTRODUCTION = """# Validation

For sceptics: the plant beside other simulators of the field, and beside itself at smaller steps. One command runs all
of it and writes this page:

```sh
pip install -e '.[validation]'
python -m bench.validation          # or some parts: {names}; exit 1 if a tolerance is broken
```

`tests/validation` asserts the same tolerances in `.ci/run`. A difference is the largest over all nodes, inverters and
steps of a case, rounded up to 1, 2 or 5 times a power of ten; pu is per unit of nominal voltage or of the inverter's
rating.
"""


def write_page(
    parts: Sequence[ValidationPart], results: Mapping[str, Sequence[CaseResult]], folder: Path = DOCS
) -> Path:
    """Write the page and the figures; a part without results keeps its section as it stands.

    Parameters
    ----------
    parts
        All parts, in the page's order.
    results
        Results of the parts that were run, by name.
    folder
        Where the page is.
    """
    page, figures = folder / PAGE_FILE, folder / FIGURES
    standing = page.read_text(encoding="utf-8") if page.exists() else ""
    sections = {section.partition("\n")[0]: section for section in standing.split("\n## ")[1:]}
    for part in parts:
        if part.name in results:
            figures.mkdir(parents=True, exist_ok=True)
            with mpl.rc_context(PAGE):
                save(part.draw(results[part.name]), figures, part.name, formats=("png",))
            sections[part.title] = _section(part, results[part.name])
    found = [sections[part.title].rstrip("\n") for part in parts if part.title in sections]
    introduction = INTRODUCTION.format(names=", ".join(f"`{part.name}`" for part in parts))
    page.write_text("\n\n## ".join([introduction.rstrip("\n"), *found]) + "\n", encoding="utf-8")
    return page


def _section(part: ValidationPart, results: Sequence[CaseResult]) -> str:
    return "\n\n".join(
        (
            part.title,
            part.text.strip("\n"),
            f"Compared with {part.references()}.",
            _table(part, results),
            f"![{part.title}]({FIGURES}/{part.name}.png)",
        )
    )


def _table(part: ValidationPart, results: Sequence[CaseResult]) -> str:
    quantities = list(dict.fromkeys(each.quantity for result in results for each in result.checks))
    facts = list(dict.fromkeys(fact for result in results for fact in result.facts))
    rows = [["case", *quantities, "limit", *facts]]
    for result in results:
        values = {each.quantity: each.text() for each in result.checks}
        limits = list(dict.fromkeys(f"{'>= ' if each.at_least else ''}{each.limit:g}" for each in result.checks))
        rows.append(
            [
                f"`{result.case}`: {part.cases[result.case]}",
                *(values.get(quantity, "") for quantity in quantities),
                ", ".join(limits),
                *(result.facts.get(fact, "") for fact in facts),
            ]
        )
    rows.insert(1, ["---"] * len(rows[0]))
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)
