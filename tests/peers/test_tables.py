"""The tables of the bench: ratios are of one round, and what is missing is named."""

from bench.peers.measured import PartRun, tables_text


def part_of(values: dict[str, list[float]], left_out: dict[str, str]) -> PartRun:
    """Measurements that nobody made."""
    return PartRun(
        began="2026-01-01 00:00 UTC", commit="abc", machine="a machine", loads=[0.1, 0.2],
        values=values, left_out=left_out,
    )  # fmt: skip


def test_a_ratio_is_the_median_of_the_rounds_in_which_both_took_turns() -> None:
    """A machine that becomes slower slows both rivals of a round; the sum of build and steps is ours."""
    values = {
        "gridlabd.plant.steps": [1.0, 20.0, 3.0],
        "ours.plant.build": [0.5, 5.0, 0.5],
        "ours.plant.steps": [0.5, 5.0, 0.5],
    }

    text = tables_text({"plant": part_of(values, {})})

    assert "| plant: GridLAB-D's steps, our build and steps | 3e+03 | 1e+03 | 2 | 1 | 3 | 3 |" in text


def test_what_was_left_out_is_named_and_has_no_row() -> None:
    """A rival without its package gives its reason, and no ratio that nobody measured."""
    text = tables_text({"tick": part_of({"ours.tick.9": [0.002]}, {"HELICS zmq": "helics is not installed"})})

    assert "HELICS zmq, empty" not in text
    assert "| tick | ours.tick.9 | s | 0.002 | 0.002 | 0.002 | 1 |" in text
    assert "left out: HELICS zmq: helics is not installed" in text
