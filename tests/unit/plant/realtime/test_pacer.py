from __future__ import annotations

import pytest

from gridpeers.plant.realtime.pacer import FIRST, RealTimePacer, sentence


def test_percentiles_are_those_of_the_delays() -> None:
    """Delays of 0 to 99 hundredths of a period: nobody is late, and the percentiles are where they should be."""
    pacer = RealTimePacer(1.0, now=10.0)
    for i in range(100):
        pacer.note(pacer.due + i / 100)
    report = pacer.report()

    assert (report.steps, report.late, report.slipped) == (100, 0, 0.0)
    assert [report.p50, report.p95, report.p99, report.worst] == pytest.approx([0.50, 0.95, 0.99, 0.99])


def test_pace_is_not_kept_if_more_than_one_percent_is_late() -> None:
    """Of the steps so far in a run without an end, after the first of them; it is news only once."""
    pacer = RealTimePacer(1.0, now=0.0)
    pacer.note(pacer.due + 2.0)
    assert not pacer.take_failure(of=None)
    for _ in range(FIRST - 2):
        pacer.note(pacer.due)
    assert not pacer.take_failure(of=None)
    pacer.note(pacer.due + 2.0)

    assert pacer.take_failure(of=None)
    assert not pacer.take_failure(of=None)


def test_a_run_with_an_end_has_failed_as_soon_as_too_many_of_its_steps_are_late() -> None:
    """Four of 350 are; nothing that comes later can make up for them."""
    pacer = RealTimePacer(1.0, now=0.0)
    news = []
    for _ in range(5):
        pacer.note(pacer.due + 2.0)
        news.append(pacer.take_failure(of=350))

    assert news == [False, False, False, True, False]


def test_a_late_step_is_made_up_for_but_a_hopeless_delay_is_not() -> None:
    """Up to ten periods the schedule stands; beyond, it moves by the delay."""
    pacer = RealTimePacer(0.1, now=0.0)
    assert pacer.note(0.9) == 0.0
    assert pacer.due == pytest.approx(0.1)
    assert pacer.note(2.1) == pytest.approx(2.0)

    assert pacer.due == pytest.approx(2.2)
    assert "put off by 2.00 s" in sentence(pacer.report(), 0.1)


def test_early_is_not_late() -> None:
    """Rounding of the clock gives no negative delays."""
    pacer = RealTimePacer(0.1, now=5.0)
    pacer.note(4.999999)

    assert pacer.report().worst == 0.0
