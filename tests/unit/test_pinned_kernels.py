"""The pinned bytes are compared wherever the processor can."""

import os
from pathlib import Path

import pytest

from tests.golden.catalogue.pins import environment, read
from tests.pinned_kernels import choose


def test_tests_compute_as_the_pins_did() -> None:
    """Where the processor has what the pins' kernels need, OpenBLAS uses these, however it names the processor."""
    if "OPENBLAS_CORETYPE" not in os.environ:
        pytest.skip("this processor cannot run the kernels of the pins")

    assert environment()["blas"] == read().environment["blas"]


def test_pins_that_a_processor_has_otherwise_differ_in_the_last_digits_alone() -> None:
    """Two processors show the same run: what moves a pin by more is a change of behaviour, on all of them."""
    pinned = read()
    for pins in pinned.otherwise.values():
        for key, pin in pins.items():
            assert pin.sha256 != pinned.pins[key].sha256
            assert pin.last == pytest.approx(pinned.pins[key].last, rel=1e-9)


def test_a_processor_without_them_is_left_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Kernels that a processor cannot run would end the tests by SIGILL."""
    monkeypatch.delenv("OPENBLAS_CORETYPE", raising=False)
    (tmp_path / "cpuinfo").write_text("flags\t\t: fpu sse2\n")

    choose(tmp_path / "cpuinfo")
    choose(tmp_path / "none")

    assert "OPENBLAS_CORETYPE" not in os.environ
