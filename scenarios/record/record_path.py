"""Find the file of a record: given it, the folder of its case, or the folder of its run and the case."""

from __future__ import annotations

from pathlib import Path

from gridpeers.scenarios.record.record_file import RecordFileError
from gridpeers.scenarios.record.record_info import FILE
from gridpeers.wire.schema.suggestion import suggestion


def record_path(path: str | Path, case: str = "") -> Path:
    """Return the file of a record, which may not be there.

    Parameters
    ----------
    path : str or Path
        The file, the folder of a case, or the folder of a run.
    case : str, optional
        Case of the run; needed if it has several.

    Raises
    ------
    RecordFileError
        If the folder has no record, none of that case, or those of several cases and none is chosen; one sentence.
    """
    if not isinstance(path, str | Path):
        raise RecordFileError(f'{path!r:.60}: needs the path of a record, as "runs/islanding/latest/IV"')
    path = Path(path)
    if not path.exists():
        return path
    if path.is_file() or (path / FILE).exists():
        file = path if path.is_file() else path / FILE
        if case and case != file.resolve().parent.name:
            raise RecordFileError(
                f'{path}: it is the record of one case, and "{case}" is another one; leave --case out'
            )
        return file
    found = {file.parent.name: file for file in sorted(path.glob(f"*/{FILE}"))}
    if not found:
        raise RecordFileError(f"{path}: there is no {FILE}: the run was not recorded, or this is no folder of a run")
    if case:
        if case not in found:
            raise RecordFileError(f'{path}: no record of case "{case}"; {suggestion(case, found, "cases")}')
        return found[case]
    if len(found) == 1:
        return next(iter(found.values()))
    raise RecordFileError(
        f"{path}: it has a record of each case, {', '.join(found)}; choose one with --case "
        f"{next(iter(found))}, or give its folder, {next(iter(found.values())).parent}"
    )
