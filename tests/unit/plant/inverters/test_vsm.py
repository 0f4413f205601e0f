"""The virtual synchronous machine against its equations, written down anew, and as a model of a user's own."""

from __future__ import annotations

import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import gridpeers as gp
from gridpeers.lab.predict.prediction import predict
from gridpeers.plant.feeder import Plant
from gridpeers.plant.inverters.inverter_model import Method
from gridpeers.plant.inverters.vsm import Vsm
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings
from gridpeers.plant.tables import read_feeder
from tests.unit.plant.dynamics.circuits import S_B, on_stiff_bus

W_NOM = 2.0 * np.pi * 60.0
M_P, M_Q = 0.02, 0.05
MACHINE = Vsm(H=0.3, D=30.0, T_q=0.03, R_f=0.02, X_f=0.2)


def swing_equation(P_set: float, V_set: float, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Integrate the published equations behind the filter at a stiff bus of 1 pu, f (Hz), p, q (pu)."""
    H, D, T_q, z = 0.3, 30.0, 0.03, 0.02 + 0.2j

    def powers(theta: float, q: float) -> complex:
        E = (V_set - M_Q * q) * np.exp(1j * theta)
        return complex(np.conj((E - 1.0) / z))  # 1 pu at angle 0, times the conjugate current

    def slopes(t: float, x: NDArray[np.float64]) -> list[float]:
        w, theta, q = x.tolist()
        S = powers(theta, q)
        return [(P_set - w / M_P - S.real - D * w) / (2.0 * H), W_NOM * w, (S.imag - q) / T_q]

    x = solve_ivp(slopes, (0.0, times[-1]), [0.0, 0.0, 0.0], "DOP853", times, rtol=1e-11, atol=1e-12).y
    S = np.array([powers(theta, q) for _, theta, q in x.T])
    return np.array([60.0 * (1.0 + x[0]), S.real, S.imag]).T


@pytest.mark.parametrize(("method", "gain"), [("first-order", 1.8), ("second-order", 3.5)])
def test_it_swings_as_its_equations_say(method: Method, gain: float) -> None:
    """A step of both set-points gives scipy's trajectory, and half the step divides the error by its order."""
    errors = []
    for h in (0.002, 0.001):
        dynamics = on_stiff_bus(MACHINE, h=h, method=method, m_p=M_P, m_q=M_Q)
        dynamics.inverters.set_points[0, :2] = 0.5, 1.03
        stride = round(0.01 / h)
        got = dynamics.run(100 * stride)[stride - 1 :: stride, 0, :3] / [1.0, S_B, S_B]
        expected = swing_equation(0.5, 1.03, 0.01 * np.arange(1, 101))
        errors.append(np.abs(got - expected).max(axis=0))

    assert np.ptp(expected[:, 0]) > 0.2  # Hz
    assert (errors[0] < [0.02, 0.01, 0.01]).all()
    assert (errors[0] / errors[1] > gain).all()


OF_A_USER = """
from cmath import phase
from math import pi
from typing import Annotated, ClassVar

import gridpeers as gp


class Machine(gp.InverterModel, frozen=True):
    \"\"\"A virtual synchronous machine.\"\"\"

    H: Annotated[float, gp.Unit("s"), gp.Plausible("an inertia constant", 0.01, 20.0), "Inertia constant (s)."] = 0.1
    D: Annotated[float, gp.Unit("pu"), "Damping (pu)."] = 0.0
    T_q: Annotated[float, gp.Unit("s"), "Filter of Q (s)."] = 0.02
    I_max: Annotated[float, gp.Unit("pu"), "Limit of a phase's current (pu)."] = 2.0
    STATES: ClassVar = ("q",)
    holds_terminal = False

    @staticmethod
    def advance(g, t, x0, x, d, h, second):
        dw = (t.P_set - x.w / g.m_p - t.P - g.D * x.w / g.w_nom) * g.w_nom / (2.0 * g.H)
        dtheta = x.w
        dq = (t.Q - x.q) / g.T_q
        x.w = gp.heun(x0.w, d.w, dw, h, second)
        x.theta = gp.heun(x0.theta, d.theta, dtheta, h, second)
        x.q = gp.heun(x0.q, d.q, dq, h, second)
        if not second:
            d.w, d.theta, d.q = dw, dtheta, dq
        x.f = (g.w_nom + x.w) / (2.0 * pi)
        gp.inject(g, t, t.V_set - g.m_q * x.q, x.theta)

    @staticmethod
    def rest(g, x, V, I, J, S, v):
        x["q"], x["theta"] = S.imag, phase(J[0] / g["y_f"])
"""

SCENARIO = """
[time]
end_s = 0.4

[plant]
P_set0_pu = 0.5

[plant.gfm]
model = "{gfm}"
D_pu = 20
X_f_pu = 0.2
{keys}

[plant.inverter.inv4]
model = "{inv4}"
H_s = 0.4

[[event]]
label = "islanding"
t_s = 0.1
open = ["13-152"]

[case.A]
secondary = "all"
graph = "full"
"""


def scenario(folder: Path, gfm: str, inv4: str, keys: str = "") -> Path:
    folder.mkdir()
    path = folder / "swing.toml"
    path.write_text(SCENARIO.format(gfm=gfm, inv4=inv4, keys=keys))
    return path


def test_a_model_of_a_user_gives_the_same_bytes(tmp_path: Path) -> None:
    """Its file is in a folder beside the scenario; a kind or one inverter uses it."""
    ours = gp.load(scenario(tmp_path / "ours", "vsm", "vsm")).run("A")
    path = scenario(tmp_path / "own", "machine:Machine", "machine:Machine")
    (path.parent / "machine.py").write_text(OF_A_USER)
    own = gp.load(path).run("A")

    assert own.sha256 == ours.sha256
    assert np.ptp(ours.history["inv1", "f"].to_numpy()) > 0.01
    again = gp.read(own.save(tmp_path / "saved"))
    assert again.sha256 == ours.sha256
    spec = gp.load(path).spec
    (tmp_path / "sent").write_bytes(pickle.dumps(spec))  # as a sweep sends it to its workers
    words = [sys.executable, "-c", "import pickle; print(pickle.load(open('sent', 'rb')).plant.inverter['inv4'])"]
    received = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert received.strip() == str(spec.plant.inverter["inv4"])


def test_a_wrong_model_is_a_problem_at_its_key(tmp_path: Path) -> None:
    """A missing model, one of the other kind, an unknown parameter, an implausible value."""
    cases = {
        "vsn": 'plant.gfm.model: there is no "vsn"; did you mean "vsm"?',
        "mine:Machine": 'plant.gfm.model: mine:Machine: there is no module "mine"',
        "current_source": 'plant.gfm.model: "current_source" is a model of a GFL, and this is a GFM',
    }
    for k, (name, words) in enumerate(cases.items()):
        with pytest.raises(gp.ScenarioError) as error:
            gp.load(scenario(tmp_path / str(k), name, "vsm"))
        assert words in str(error.value)
    with pytest.raises(gp.ScenarioError) as error:
        gp.load(scenario(tmp_path / "keys", "vsm", "gridlabd", "H_s = 200\nT_p_s = 0.1"))
    text = str(error.value)
    assert 'plant.gfm.T_p_s: unknown key; did you mean "T_q_s"?' in text
    assert "plant.gfm.H_s: 200 s is not plausible for an inertia constant" in text
    assert "plant.inverter.inv4" in text


@pytest.mark.parametrize(("right", "wrong", "words"), [
    ("/ g.T_q", "/ g.T_x", "its method advance fails (machine.py:23): AttributeError"),
    ("x.q = gp", "x.z = gp", "its pass sets z, which its STATES do not name"),
    ('("q",)', '("w", "q")', "its STATES must be a tuple of names, each one once and beside theta, w and f"),
    ('("q",)', '"q"', "its STATES must be a tuple of names"),
    ("x.q = gp", "if x.q > 9.0:\n            raise ValueError\n        x.q = gp", "its pass raises an error"),
    ("holds_terminal = False", "admittance = lambda self, rating: 1j * float('nan')", "its admittance is (nan"),
    ("holds_terminal = False", "response = lambda self: -0.1", "its response is -0.1; it must be None, or a"),
    ("holds_terminal = False", "response = None", "its method response fails: TypeError"),
    ("def rest(", "def begin(", "it has no static method rest"),
    ("    @staticmethod\n    def rest(", "    def rest(", "it has no static method rest"),
])  # fmt: skip
def test_a_pass_with_a_mistake_is_refused_with_its_line(tmp_path: Path, right: str, wrong: str, words: str) -> None:
    """`check` runs the pass once as a function of Python, whose errors say more than the compiler's."""
    path = scenario(tmp_path / "own", "machine:Machine", "machine:Machine")
    (path.parent / "machine.py").write_text(OF_A_USER.replace(right, wrong))

    with pytest.raises(gp.ScenarioError) as error:
        gp.load(path)
    assert words in str(error.value)


def test_a_start_with_a_mistake_names_the_inverter_and_the_line(tmp_path: Path) -> None:
    path = scenario(tmp_path / "own", "machine:Machine", "machine:Machine")
    (path.parent / "machine.py").write_text(OF_A_USER.replace('g["y_f"]', 'g["yf"]'))

    with pytest.raises(gp.ScenarioError, match=r"inv1: rest of the inverter model Machine fails \(machine.py:34\)"):
        gp.load(path).check()


@pytest.mark.parametrize("state", ["q", "z"])
def test_a_model_without_a_finite_result_breaks_the_run(tmp_path: Path, state: str) -> None:
    """The run names inverter and model, not the island, though no current depends on z."""
    path = scenario(tmp_path / "own", "machine:Machine", "machine:Machine")
    wrong = f"if x.q > 0.2:\n            x.{state} = (x.q - 1e3) ** 0.5\n        x.f ="
    (path.parent / "machine.py").write_text(OF_A_USER.replace("x.f =", wrong).replace('("q",)', '("q", "z")'))

    with pytest.raises(RuntimeError, match="inv1: the inverter model Machine gives a current or a state that is no"):
        gp.load(path).run("A")


def test_predict_says_that_it_cannot(tmp_path: Path) -> None:
    """A model without a linear response is named; a prediction with another model would be wrong."""
    with pytest.raises(gp.ScenarioError, match=r'inv\d+: the model "vsm" has no linear response'):
        predict(scenario(tmp_path / "ours", "vsm", "vsm"), "A")


def test_gridlab_d_refuses_it(tmp_path: Path) -> None:
    """GridLAB-D has no such inverter, and `check` says so before anything starts."""
    path = scenario(tmp_path / "ours", "vsm", "vsm")
    path.write_text(path.read_text().replace("[plant]", '[plant]\nsimulator = "gridlabd"'))

    with pytest.raises(gp.ScenarioError, match=r'plant\.gfm\.model: GridLAB-D has no such GFM, got "vsm" at inv1'):
        gp.load(path)


def test_the_feeder_rests_with_machines_and_droops_beside_each_other() -> None:
    """Of one island each model has its own rows: nothing moves before an event, and all end at one frequency."""
    settings = PlantSettings(gfm=Vsm(D=20.0))
    feeder = read_feeder("microgrid123")
    rows = tuple(replace(row, own={"model": "gridlabd"}) if row.name == "inv7" else row for row in feeder.inverters)
    plant = Plant(Network(replace(feeder, inverters=rows)), settings, 0.02, 0.02)
    first = plant.measure()
    for _ in range(50):
        plant.advance()

    for name, now in plant.measure().items():
        assert pytest.approx(first[name].P, abs=1e-4) == now.P
        assert pytest.approx(first[name].f, abs=1e-9) == now.f
