"""Laws of metals at a point beside their rates integrated apart, in scenes, and refused where values make no sense."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import warp as wp
from outside import holds_up
from test_own_rates import bar as striking_bar

import warp_mca as mca
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.materials.laws import law_functions
from warp_mca.verify.metals import METALS, STEEL, integrated

TIME, EVERY = np.linspace(0.0, 1e-3, 16001), 8  # steps, and those that are compared


@cache
def drive_kernel(precision: str, law: str) -> Any:
    """Kernel: the stress of a point in every step of a course of strain, and the history after it."""
    t, functions = scalars(precision), law_functions(law, precision)
    R, mat33, rows = t.real, t.mat33, wp.types.vector(functions.size, t.real)
    rated, parameters = functions.rated, functions.parameters
    law_flow, return_map = functions.flow, functions.return_map

    @wp.kernel(enable_backward=False, module="unique")
    def drive(
        strain: wp.array(dtype=mat33),
        start: rows,
        law: wp.array2d(dtype=R),
        dt: R,
        S_out: wp.array(dtype=mat33),
        history_out: wp.array(dtype=rows),
    ):
        G = law[0, 1]
        c = parameters(law, 0, R(1.0))
        h = start
        eps_p = mat33()
        p = R(0.0)
        for i in range(strain.shape[0]):
            if wp.static(rated):
                S, h, _dp = law_flow(R(2.0) * G * strain[i], h, dt, G, c)
            else:
                S, eps_p, p = return_map(R(2.0) * G * strain[i], eps_p, p, G, c)
                h[5] = p
            S_out[i] = S
        history_out[0] = h

    return drive


def driven(
    metal: mca.Elastic, strain: np.ndarray, dt: float, precision: str, start: tuple[float, ...] = ()
) -> tuple[np.ndarray, np.ndarray]:
    """Deviatoric stress [Pa] in every row of deviatoric strain, one step dt [s] each, and the history at the end."""
    t, size = scalars(precision), law_functions(metal.law, precision).size
    S = wp.zeros(len(strain), dtype=t.mat33, device="cpu")
    rows = wp.types.vector(size, t.real)
    h = wp.zeros(1, dtype=rows, device="cpu")
    law = wp.array([list(metal.parameters)], dtype=t.real, device="cpu")
    course = wp.array(strain, dtype=t.mat33, device="cpu")
    begin = rows(*(*start, *[0.0] * (size - len(start))))
    wp.launch(drive_kernel(precision, metal.law), 1, inputs=[course, begin, law, dt], outputs=[S, h], device="cpu")
    return S.numpy().astype(float), h.numpy()[0].astype(float)


@cache
def random_course() -> np.ndarray:
    """Deviatoric strain up to some percent, at some 100 1/s: random waves of every component."""
    rng, s = np.random.default_rng(47), TIME / TIME[-1]
    waves = np.array([np.sin(np.pi * k * s) * np.sin(np.pi * s) for k in (1, 2, 3, 5)])
    a = np.einsum("kt,kij->tij", waves, rng.normal(0.0, 0.006, (4, 3, 3)))
    a = 0.5 * (a + np.swapaxes(a, 1, 2))
    return a - np.trace(a, axis1=1, axis2=2)[:, None, None] / 3.0 * np.eye(3)


@cache
def known(name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What SciPy makes of the rates of this law."""
    return integrated(METALS[name], random_course()[::EVERY], TIME[::EVERY])


@pytest.mark.parametrize("precision", ["mixed", "float64"])
@pytest.mark.parametrize("name", METALS)
def test_random_strain_gives_the_integrated_stress(name: str, precision: str):
    metal, (S, p, work) = METALS[name], known(name)
    found, history = driven(metal, random_course(), float(TIME[1]), precision)
    off = float(np.abs(found[::EVERY] - S).max())
    assert p[-1] > 0.03 and off < 1e-3 * metal.yield_stress
    assert history[5] == pytest.approx(p[-1], rel=1e-3)
    if law_functions(metal.law, precision).rated:
        row = 16 if name == "Chaboche" else 7
        assert history[row] == pytest.approx(work[-1], rel=1e-3)


def test_flow_slower_than_the_rounding_of_the_plastic_strain_has_its_rate():
    """At p = 0.5 steps of 10 ns at 1 1/s add a sixth of what float32 resolves."""
    metal, dt, p = METALS["Cowper-Symonds"], 1e-8, 0.5
    assert isinstance(metal, mca.CowperSymonds)
    before = p * np.array([1.0, -0.5, 0.0, 0.0, 0.0])
    elastic = metal.stress[-1] * (1.0 + metal.D ** (-1.0 / metal.q)) / (3.0 * metal.shear_modulus)
    grown = p + elastic + dt * np.arange(4000)
    axial = np.diag([1.0, -0.5, -0.5])
    S, _ = driven(metal, grown[:, None, None] * axial, dt, "mixed", (*before, p))
    q = 1.5 * S[-1000:, 0, 0]
    assert q == pytest.approx(metal.stress[-1] * (1.0 + (1.0 / metal.D) ** (1.0 / metal.q)), rel=2e-3)


@pytest.mark.parametrize(
    ("name", "device"),
    [("Cowper-Symonds", "cpu"), *(pytest.param(name, "cuda:0", marks=pytest.mark.gpu) for name in METALS)],
)
def test_a_bar_of_it_strikes(name: str, device: str, tmp_path: Path):
    """Alone, in a batch, from a saved state and with several rates."""
    result = holds_up(striking_bar("hex8r", METALS[name], 40.0), device, tmp_path)
    assert result.summary["max_plastic_strain"] > 1e-3


COOK = {"A": 9e7, "B": 3e8, "n": 0.3, "C": 0.02, "m": 1.0, "T_melt": 1356.0, "c_p": 383.0}
WRONG: list[tuple[type[mca.Elastic], dict, str]] = [
    (mca.J2Voce, {"sigma_y": 1e8, "Q": -1.0, "b": 1.0}, r"^J2Voce\.Q = -1\.0: give a finite number, 0 or more"),
    (mca.J2Table, {"plastic_strain": (0.0, 0.1), "stress": (1e8,)}, "give as many stresses as plastic strains, 2"),
    (mca.J2Table, {"plastic_strain": (0.1,), "stress": (1e8,)}, "begin with 0, and let each strain be above"),
    (mca.J2Table, {"plastic_strain": (0.0, 0.1), "stress": (2e8, 1e8)}, "let no stress be below the one before"),
    (mca.J2Table, {"plastic_strain": 0.0, "stress": (1e8,)}, "give a finite number for each point"),
    (mca.CowperSymonds, {"plastic_strain": (0,), "stress": (1e8,), "D": 40.0, "q": 0.2}, r"CowperSymonds\.q = 0\.2"),
    (mca.JohnsonCook, {**COOK, "T_melt": 200.0}, "give a temperature above T_room = 293 K"),
    (mca.JohnsonCook, {**COOK, "T_start": 2000.0}, "give a temperature below T_melt = 1356 K"),
    (mca.JohnsonCook, {**COOK, "beta": 1.5}, "must lie between 0"),
    (mca.Chaboche, {"sigma_y": 1e8, "C": (1e9,), "gamma": (1.0, 1.0)}, r"Chaboche\.C = \(1000000000\.0,\): give 2"),
]


@pytest.mark.parametrize(("kind", "values", "words"), WRONG)
def test_values_that_make_no_law_are_refused(kind: type[mca.Elastic], values: dict, words: str):
    with pytest.raises(mca.RequestError, match=words):
        kind(**STEEL, **values)


def test_the_library_has_a_source_for_each_material():
    known = {name: item for name, item in vars(mca.library).items() if isinstance(item, mca.Elastic)}
    assert known == mca.library.materials() and len(known) == 24
    assert len(set(known.values())) == 24
    assert all(
        2300.0 < item.rho < 9000.0 and 3.9e3 < item.wave_speeds["dilatational"] < 7e3
        for item in known.values()
        if item.E > 5e9
    )
