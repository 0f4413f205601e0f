"""How a file of the catalogue, or one of the user's own, is found."""

from __future__ import annotations

from pathlib import Path

from scenarios.catalogue_files import names_in
from scenarios.schema.scenario_errors import ScenarioError
from wire.suggestion import suggestion


def find_file(name: str, folder: Path, what: str) -> Path:
    """Path of a file named as in a catalogue or given as a path.

    Parameters
    ----------
    name : str
        Name or path, as the user gave it.
    folder : Path
        Folder of the catalogue.
    what : str
        What its files are, for the message.

    Raises
    ------
    ScenarioError
        If there is neither, or the system does not let one look.

    Examples
    --------
    >>> from scenarios.catalogue_files import CATALOGUE, SWEEPS
    >>> find_file("islanding", CATALOGUE, "scenario").name
    'islanding.toml'
    >>> find_file("gain", SWEEPS, "sweep")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    scenarios.schema.scenario_errors.ScenarioError: no sweep "gain"; did you mean "gains"? ...
    """
    names = names_in(folder)
    if name in names:
        return folder / f"{name}.toml"
    path = Path(name)
    listed = ", ".join(names)
    try:
        is_file, is_dir = path.is_file(), path.is_dir()
    except OSError as error:  # a name too long, a folder that is closed to us
        raise ScenarioError([f"{name}: cannot be read: {error.strerror}"]) from None
    if is_file:
        return path
    if is_dir:
        raise ScenarioError([f"{name}: this is a folder; give a {what} file (.toml) or a name: {listed}"])
    if path.suffix == ".toml" or len(path.parts) > 1:
        raise ScenarioError([f"{name}: there is no such file; give the path of a {what} file, or a name: {listed}"])
    raise ScenarioError([f'no {what} "{name}"; {suggestion(name, names, f"{what}s of the catalogue")}'])
