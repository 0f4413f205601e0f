from __future__ import annotations

import sys
from pathlib import Path

import pytest

from gridpeers.wire.wording import not_importable


def error_of(folder: Path, statement: str) -> ImportError:
    file = folder / "module_of_ours.py"
    file.write_text(statement)
    with pytest.raises(ImportError) as caught:
        exec(compile(statement, str(file), "exec"), {"__name__": "gridpeers.plant.module_of_ours"})
    return caught.value


@pytest.mark.parametrize(("package", "installs"), [("zenoh", "eclipse-zenoh"), ("mcap", "mcap"), ("joblib", "joblib")])
def test_a_missing_package_is_named_with_what_to_install(
    package: str, installs: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the name that pip knows."""
    monkeypatch.setitem(sys.modules, package, None)

    text = not_importable(error_of(tmp_path, f"import {package}"))

    assert "is not installed; gridpeers needs it: pip install " + installs in text
    assert "\n" not in text


def test_a_package_that_does_not_load_is_named_with_its_reason(tmp_path: Path) -> None:
    """A system library or a part of the installation is missing. The message says to install it again."""
    said = not_importable(error_of(tmp_path, "from json import no_such_name"))

    assert said.startswith("json is installed, but cannot be imported (ImportError: cannot import name")
    assert said.endswith("gridpeers needs it: pip install --force-reinstall json")
