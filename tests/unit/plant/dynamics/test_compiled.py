import shutil
from pathlib import Path

import pytest

from plant.dynamics.kernel import compiled

SOURCES = sorted(path for path in Path(compiled.__file__).parent.glob("*.py") if "\n@compiled\n" in path.read_text())


@pytest.mark.parametrize("source", SOURCES, ids=lambda path: path.name)
def test_an_edit_of_compiled_code_renames_its_cache(
    source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whichever file with compiled code is edited, machine code of the text before is not loaded again."""
    folder = Path(shutil.copytree(source.parent, tmp_path / "dynamics", ignore=shutil.ignore_patterns("__pycache__")))
    monkeypatch.setattr(compiled, "_HERE", folder)
    before = compiled.cache_folder()

    with (folder / source.name).open("a") as file:
        file.write("\n")

    assert compiled.cache_folder() != before
