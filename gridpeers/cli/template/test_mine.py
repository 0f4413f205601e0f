"""What my law does, held to it: `pytest` runs this file."""

from pathlib import Path

import gridpeers as gp

HERE = Path(__file__).parent


def test_my_law_restores_the_frequency_and_shares_the_power():
    """After each event the frequency is back at nominal, and all inverters carry equal shares."""
    run = gp.load(HERE / "mine.toml").run("mine")

    assert (run.metrics["f_error_Hz"] < 0.01).all(), run.metrics["f_error_Hz"]
    assert (run.metrics["MPSI"] < 0.01).all(), run.metrics["MPSI"]
