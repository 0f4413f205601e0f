"""Hooks of mkdocs: parts of pages that the code gives, pages that are files of the root, comments for the tests."""

from __future__ import annotations

import inspect
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

import gridpeers as gp
from gridpeers.cli.root import app
from gridpeers.scenarios.reference import TOPICS, field_docs, markdown_table, page

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files

ROOT = Path(__file__).parents[1]

OF_SEVERAL = 5
"""An option that as many commands have, in the same words, is described once."""

_CHAPTERS = {
    r"scenario$|runs|feeder": "Scenarios, runs and results",
    r"lab.*\.\w+$(?<!parts)": "Theory and replay",
    r"agents": "Control laws and graphs",
    r"netem": "Link faults",
    r"plant": "Inverter models",
    r"scenarios\.(checks|results\.(claims|findings|metric|window))": "Metrics, checks and claims",
    r"wire": "Parameters",
    r"": "Errors, the catalogue and further modules",
}
"""Chapters of the reference of Python, by a pattern of the module of a name; `theory_parts` is a further module."""


def command_line() -> Iterator[str]:
    """Yield every command with its arguments and options, in the groups of `gridpeers --help`."""
    group: Any = typer.main.get_command(app)
    context = group.make_context("gridpeers", [], resilient_parsing=True)
    chapters: dict[str, list[tuple[Any, list[tuple[str, str]]]]] = {
        title: [of for name in names for of in _commands(name, group.get_command(context, name), context)]
        for title, names in group.groups(context).items()
        if names
    }
    counts = Counter(record for commands in chapters.values() for _, records in commands for record in records)
    common = [record for record, count in counts.items() if count >= OF_SEVERAL and record[0].startswith("-")]
    for title, commands in chapters.items():
        yield from ("", f"### {title}")
        for of, records in commands:
            yield from ("", f"#### {of.command_path}", "", *_docstring(of.command.help))
            yield from _options(record for record in records if record not in common)
            if also := [f"`{names.split()[0].rstrip(',')}`" for names, _ in records if (names, _) in common]:
                yield from ("", f"Also [options of several commands](#options-of-several-commands): {', '.join(also)}.")
    yield from ("", "### Options of several commands", "", *_options(common))


def _commands(name: str, command: Any, parent: Any) -> Iterator[tuple[Any, list[tuple[str, str]]]]:
    """Yield a command and those below it: the context, and names and meaning of each argument and option."""
    context = command.make_context(name, [], parent=parent, resilient_parsing=True)
    records = [param.get_help_record(context) for param in command.get_params(context)]
    yield context, [record for record in records if record and "--help" not in record[0]]
    for below in command.list_commands(context) if hasattr(command, "list_commands") else ():
        yield from _commands(below, command.get_command(context, below), context)


def _options(records: Iterable[tuple[str, str]]) -> Iterator[str]:
    if rows := [(f"`{names}`", _plain(meaning)) for names, meaning in records]:
        yield from markdown_table(("argument or option", "meaning"), rows)


def python() -> Iterator[str]:
    """Yield every public name with its signature and docstring, in chapters."""
    chapters: dict[str, list[str]] = {title: [] for title in _CHAPTERS.values()}
    for name, home in gp._homes().items():  # noqa: SLF001
        module = home.partition(":")[0].removeprefix("gridpeers.")
        chapters[next(title for pattern, title in _CHAPTERS.items() if re.match(pattern, module))].append(name)
    for title, names in chapters.items():
        yield from ("", f"### {title}")
        for name in names:
            it = getattr(gp, name)
            yield from ("", f"#### gp.{name}", "", *_signature(name, it), *_docstring(inspect.getdoc(it)))
            if isinstance(it, type):
                yield from _members(it)


def _members(cls: type) -> Iterator[str]:
    """Yield the fields of a class, its properties and its methods, each with its sentence."""
    yield ""
    for field, (_, text) in field_docs(cls).items():
        if text and not field.startswith("_"):
            yield f"- `{field}`: {_plain(text)}"
    documented = [base for base in cls.__mro__ if base is cls or base.__name__.startswith("_From")]
    for name, member in (entry for base in reversed(documented) for entry in vars(base).items()):
        it = getattr(member, "fget", None) or getattr(member, "func", None) or getattr(member, "__func__", member)
        text, _, rest = (inspect.getdoc(it) or "").partition("\n\n")
        if text and inspect.isfunction(it) and not name.startswith("_"):
            called = f"({', '.join(_parameters(it))})" if it is member or hasattr(member, "__func__") else ""
            yield f"- `{name}{called}`: {_plain(' '.join(text.split()))}"
            if section := re.search(r"Parameters\n-+\n(.*?)(\n\n|\Z)", rest, re.S):
                yield from _entries(section[1], "    ")


def _parameters(it: Callable[..., Any]) -> list[str]:
    return [
        re.sub(r"<function (\w+) at \w+>", r"\1", str(of.replace(annotation=of.empty)))
        for of in inspect.signature(it).parameters.values()
        if of.name != "self"
    ]


def _signature(name: str, it: Any) -> tuple[str, ...]:
    if inspect.isfunction(it):
        return (f"`gp.{name}({', '.join(_parameters(it))})`", "")
    return ()


def _docstring(text: str | None) -> Iterator[str]:
    """Yield a docstring as Markdown: parameters as a list, sessions as blocks, a command's example as code."""
    for paragraph in inspect.cleandoc(text or "").split("\n\n"):
        if paragraph.startswith(">>>"):
            yield from ("```pycon", paragraph, "```", "")
        elif example := re.fullmatch(r"Example: +(.*)", paragraph, re.S):
            yield from (f"Example: `{' '.join(example[1].split())}`", "")
        elif section := re.match(r"(\w+)\n-+\n(.*)", paragraph, re.S):
            yield from (f"{section[1]}:", "")
            yield from (*_entries(section[2]), "")
        else:
            yield from (_plain(paragraph), "")


def _entries(section: str, indent: str = "") -> Iterator[str]:
    """Yield the parameters of a docstring as a list."""
    for entry in re.split(r"\n(?! )", section):
        head, _, meaning = entry.partition("\n")
        yield f"{indent}- `{head.partition(' : ')[0]}`: {_plain(' '.join(meaning.split()))}"


def _plain(text: str) -> str:
    """Return text in which nothing but code is markup, and a path of a page a link; all parts are in one folder."""
    parts = re.split(r"(`[^`]*`)", text)
    plain = (part if part[:1] == "`" else re.sub(r"([*_\[])", r"\\\1", part).replace("<", "&lt;") for part in parts)
    return re.sub(r"(?<!`)docs/([\w/-]+\.md)", r"[\1](../\1)", "".join(plain))


def _topic(topic: str) -> Iterator[str]:
    """Yield what `gridpeers doc` prints of a topic, without its title, and a level lower."""
    for line in page(topic).splitlines()[1:]:
        yield re.sub("^## ", "### ", _plain(line))


def _changelog() -> str:
    return (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").partition("\n## ")[2].replace("\n## ", "\n### ")


PARTS: dict[str, Callable[[], Iterator[str]]] = {
    "command line": command_line,
    "python": python,
    **{f"doc {topic}": lambda topic=topic: _topic(topic) for topic in TOPICS},
    "changelog": lambda: iter([f"### {_changelog()}"]),
}
"""Generated parts, by the word after `generated:` in a page's comment."""


def part(name: str) -> str:
    """Return a generated part as Markdown."""
    return "\n".join(PARTS[name]())


def from_root(name: str) -> str:
    """Return a file of the root as a page: links to pages go by their names, other files are named."""
    text = (ROOT / name).read_text(encoding="utf-8")
    text = re.sub(r"\]\(docs/", "](", text)
    return re.sub(r"\[([^\]]+)\]\((?!https?:|#|[\w/-]+\.md)[^)]*\)", r"\1", text)


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Show the version."""
    config.site_name = f"gridpeers {version('gridpeers')}"
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the page that is a file of the root."""
    from mkdocs.structure.files import File

    files.append(File.generated(config, "contributing.md", content=from_root("CONTRIBUTING.md")))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put generated parts in, show a file's name as the title of its block, and drop the comments for the tests."""
    markdown = markdown.replace("../CONTRIBUTING.md", "contributing.md")  # the file of the root, as a page
    # the line before the comment is for readers of the source
    markdown = re.sub(
        r"^(?:\(.*\)\n)?<!-- *generated: *(.*?) *-->$", lambda found: part(found[1]), markdown, flags=re.M
    )
    markdown = re.sub(r"^( *)<!-- *file: *(.*?) *-->\n(\s*```\w+)", r'\3 title="\2"', markdown, flags=re.M)
    markdown = re.sub(r"^\|.*", lambda row: re.sub(r"`[^`]+`", _unescaped, row[0]), markdown, flags=re.M)
    return re.sub(r"^ *<!-- *(skip|exit|file):.*?-->\n", "", markdown, flags=re.M | re.S)


def _unescaped(code: re.Match[str]) -> str:
    """Return code of a table as mkdocs wants it: GitHub needs a backslash before a bar, and mkdocs would show it."""
    return code[0].replace("\\|", "|")
