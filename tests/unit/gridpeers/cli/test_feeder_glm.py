"""`gridpeers feeder glm`: a feeder as a model for GridLAB-D."""

from pathlib import Path

import pytest

from tests.command_line import invoke


def test_a_feeder_becomes_a_model_with_the_inverters_of_a_scenario(elsewhere: Path) -> None:
    """The file has every inverter, with the ratings of the feeder, and names where the voltages will be."""
    code, printed = invoke("feeder", "glm", "microgrid123", "--scenario", "islanding", "--out", "mine.glm")

    assert code == 0, printed
    text = Path("mine.glm").read_text()
    assert text.startswith("// microgrid123, load set event2, by gridpeers.")
    assert text.count("object inverter_dyn") == 9
    assert text.count("rated_power 600000.0;") == 3
    assert 'filename "mine_voltages.csv";' in text


@pytest.mark.parametrize(("words", "text"), [
    (("imported",), "was imported: its elements are admittance matrices"),
    (("Master.dss",), "no feeder of our own tables"),
    (("standard123", "--scenario", "islanding"), '"islanding" is on feeder "microgrid123", not on "standard123"'),
    (("microgrid123", "--scenario", "islanding", "--case", "V"), 'no case "V"; did you mean "IV"?'),
    (("microgrid123", "--case", "IV"), "name it with --scenario"),
    (("microgrid123", "--load-set", "nix"), "there are event2, main"),
    (("microgrid123", "--out", "no/x.glm"), "no/x.glm: cannot be written"),
])  # fmt: skip
def test_a_feeder_that_cannot_be_a_model_is_told_in_one_line(
    elsewhere: Path, words: tuple[str, ...], text: str
) -> None:
    """Exit code 2 and one line; no model is written."""
    imported = Path("imported")
    imported.mkdir()
    (imported / "buses.csv").write_text("bus,phases,V_nom_kV_LL\na,ABC,4.16\nb,ABC,4.16\n")
    (imported / "source.csv").write_text("bus,V_pu,angle_deg\na,1,0\n")
    rows = [f"line{phase},a.{phase} b.{phase},1.0 -1.0 -1.0 1.0" for phase in "ABC"]
    (imported / "elements.csv").write_text("\n".join(["element,nodes,Y_S", *rows]) + "\n")
    head = "load,bus,from_phase,to_phase,P_kW,Q_kvar,V_nom_kV,n_P,n_Q,V_low_pu,V_min_pu,V_max_pu,edge,V_off_pu"
    (imported / "load_parts_main.csv").write_text(f"{head}\nx,b,A,,10,0,2.4,0,0,0.5,0.8,1.2,0,0\n")

    code, printed = invoke("feeder", "glm", *words)

    assert code == 2
    assert text in printed
    assert len(printed.strip().splitlines()) == 1
    assert not list(Path().rglob("*.glm"))
