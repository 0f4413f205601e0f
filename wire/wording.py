"""Words and texts for people: numbers of things, "did you mean", one printable line, packages to install. Pure."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

UNPRINTABLE = (
    "\x00-\x1f\x7f-\x9f\xad\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb\U000e0000-\U000e007f"
)
"""Characters that are invisible, or change the look of others: controls, line ends, writing directions, tags."""

_UNPRINTABLE = re.compile(f"[{UNPRINTABLE}\ud800-\udfff]")


class InputError(ValueError):
    """An input cannot be used; the message says why. It ends a command with exit code 2."""


def printable(text: str, limit: int = 4000) -> str:
    r"""Return a text with its unprintable characters spelt out, as \x0a, cut to a length.

    Pass every text from an error or a file through this before you send it: receivers reject a control character.
    """
    text = _UNPRINTABLE.sub(lambda match: f"\\x{ord(match[0]):02x}", text)
    return text if len(text) <= limit else text[: limit - 3] + "..."


def utf8(text: str) -> str:
    """Return a text for a file: what Python keeps of bytes that are no UTF-8, as in names of files, is spelt out."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def counted(number: int, one: str, several: str = "") -> str:
    return f"{number} {one if number == 1 else several or f'{one}s'}"


LONGEST_LIST = 30
"""Names that are listed at the most: all commands, or keys of a table of a scenario, but not all buses of a feeder."""


def suggestion(wrong: str, known: Iterable[str], what: str, also: Iterable[str] = (), *, brief: bool = False) -> str:
    """Sentence that names what was probably meant and what there is.

    Known names come in the order in which a reader wants them; `also` may be meant too, and are not listed. A `brief`
    sentence lists the names only if none is near.

    Examples
    --------
    >>> suggestion("Inv22", ["inv1", "inv2"], "inverters")
    'did you mean "inv2"? The inverters are inv1, inv2'
    >>> suggestion("Inv22", ["inv1", "inv2"], "inverters", brief=True)
    'did you mean "inv2"?'
    >>> suggestion("zebra", map(str, range(1, 135)), "buses")  # doctest: +ELLIPSIS
    'the buses are 1, 2, 3, ..., 30 and 104 more'
    """
    names = list(known)
    near = _nearest(str(wrong), [*names, *also])
    beyond = len(names) - LONGEST_LIST
    if near and (brief or beyond > 0):
        return f'did you mean "{near}"?'
    there = f"he {what} are {first_of(names, LONGEST_LIST)}" if names else f"here are no {what}"
    return f'did you mean "{near}"? T{there}' if near else f"t{there}"


def first_of(names: Sequence[str], most: int) -> str:
    beyond = len(names) - most
    return ", ".join(names[:most]) + (f" and {beyond} more" if beyond > 0 else "")


def _nearest(wrong: str, names: list[str]) -> str:
    """The name that begins so, else the one that is most alike, whatever the case of letters; "" if none is."""
    import difflib  # takes longer to import than an agent's configuration to read, and few ever need it

    by_lower = {name.lower(): name for name in names}
    wrong = wrong.lower()
    longer = [name for name in by_lower if len(wrong) >= 3 and name.startswith(wrong)]
    near = sorted(longer, key=len)[:1] or difflib.get_close_matches(wrong, by_lower, n=1)
    return by_lower[near[0]] if near else ""


def is_no_path(text: str) -> bool:
    """Whether a text names no file on any system: too long, or with what no name has."""
    try:
        raw = text.encode()
    except UnicodeEncodeError:  # half a character
        return True
    return b"\0" in raw or len(raw) > 4000 or any(len(part) > 255 for part in raw.split(b"/"))


DISTRIBUTIONS = {
    "dss": "dss-python dss-python-backend",
    "material": "mkdocs-material",
    "py_dss_interface": "py-dss-interface",
    "zenoh": "eclipse-zenoh",
}
"""What pip calls a package, where it has another name there."""


def damaged(module: str, reason: str, user: str) -> str:
    """Return one line on a package that is installed, and cannot be imported for a reason."""
    again = f"pip install --force-reinstall {DISTRIBUTIONS.get(module, module)}"
    return f"{module} is installed, but cannot be imported ({' '.join(reason.split())}); {user} needs it: {again}"


def not_importable(error: ImportError) -> str:
    """Return one line on the package that an import of ours did not find or could not load, and what to install."""
    module = (error.name or "").partition(".")[0]
    if isinstance(error, ModuleNotFoundError):
        package = DISTRIBUTIONS.get(module, module)
        return f"{package} is not installed; gridpeers needs it: pip install {package}"
    return damaged(module or "a package", f"{type(error).__name__}: {error}", "gridpeers")
