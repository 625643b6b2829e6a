"""A material of the user's own: law (`voce.py`), dataclass and one registration, and every element computes it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import warp as wp
from scipy.integrate import quad
from scipy.optimize import brentq
from test_elements import held_of

import warp_mca as mca
from warp_mca.base.errors import RequestError
from warp_mca.kernels.elements import hex8r_patch
from warp_mca.kernels.hardware.early_launch import MIN_ARCH
from warp_mca.recorders.colours import ColourScale
from warp_mca.scene import model_file as scene_file
from warp_mca.scene.materials import MATERIALS
from warp_mca.step.output import NodalStress
from warp_mca.step.state_figures import max_plastic_strain


@dataclass(frozen=True, kw_only=True)
class Voce(mca.Elastic):
    """Isotropic hardening from sigma_0 to sigma_s [Pa], by all but 1 / e of the way at the plastic strain p_0 [-]."""

    sigma_0: float
    sigma_s: float
    p_0: float
    law = "voce"

    @property
    def parameters(self) -> tuple[float, ...]:
        """K, G, sigma_0, sigma_s [Pa] and p_0 [-]."""
        return *super().parameters, self.sigma_0, self.sigma_s, self.p_0

    def yield_at(self, p: float) -> float:
        """Yield stress [Pa] at a plastic strain."""
        return self.sigma_0 + (self.sigma_s - self.sigma_0) * (1.0 - np.exp(-p / self.p_0))


ELASTIC = {"E": 70e9, "nu": 0.3, "rho": 2700.0}
VOCE = Voce(**ELASTIC, sigma_0=60e6, sigma_s=180e6, p_0=4e-3)
METAL = mca.J2Bilinear(**ELASTIC, sigma_y=60e6, E_t=7e9, beta=0.3)
# Every element by each of its kernels, and both precisions of the functions of the law.
KINDS = [
    ("hex8", "corotational", "mixed"),
    ("hex8", "finite", "mixed"),
    ("hex8r", "corotational", "mixed"),
    ("hex8r", "finite", "float64"),
    ("tet4", "corotational", "mixed"),
    ("tet4", "finite", "float64"),
]


@pytest.fixture(autouse=True)
def registered(register: Callable[..., object]) -> None:
    """The one registration."""
    register(Voce)


def step(e: float, eps_p: float, p: float) -> tuple[float, float]:
    """Axial and equivalent plastic strain after an isochoric stretch to the axial strain e, in one step."""
    G = VOCE.shear_modulus
    q = 3.0 * G * (e - eps_p)
    if abs(q) <= VOCE.yield_at(p):
        return eps_p, p
    dp = brentq(lambda dp: abs(q) - 3.0 * G * dp - VOCE.yield_at(p + dp), 0.0, abs(e - eps_p), xtol=1e-16)
    return eps_p + np.sign(q) * dp, p + dp


@pytest.mark.parametrize(("element", "kinematics", "precision"), KINDS)
def test_a_stretched_block_has_the_stress_and_energy_of_the_law(element: str, kinematics: str, precision: str):
    """Below yield, beyond it, back beyond it on the other side, and back a little: isochoric, without rotation."""
    block = mca.Box(size=(0.02, 0.01, 0.01), divisions=(2, 1, 1)).build()
    held = held_of(block, element, kinematics, precision, VOCE)
    X = held.solver.model.X
    recorded = NodalStress(held.solver, np.arange(len(X), dtype=np.int32))
    G, eps_p, p = VOCE.shear_modulus, 0.0, 0.0
    digits = 1e-9 if precision == "float64" else 3e-5
    for e in (5e-4, 0.02, -0.01, -0.0095):
        grow = [e, -0.5 * e, -0.5 * e]
        held.forces(X * (np.expm1(grow) if kinematics == "finite" else grow))
        eps_p, p = step(e, eps_p, p)
        with wp.ScopedDevice("cpu"):
            recorded.launch(held.state)
        elastic, plastic = held.energies()[:2].astype(float).sum(axis=1) / 2e-6
        assert recorded.plastic.numpy() == pytest.approx(p, rel=max(digits, 1e-6), abs=1e-12)
        assert recorded.von_mises.numpy() == pytest.approx(3.0 * G * abs(e - eps_p), abs=max(digits, 1e-6) * 60e6)
        assert elastic == pytest.approx(1.5 * G * (e - eps_p) ** 2, rel=digits)
        assert plastic == pytest.approx(quad(VOCE.yield_at, 0.0, p)[0], rel=digits)
    assert p > 0.02 and max_plastic_strain(held.solver, held.state) == pytest.approx(p, rel=digits)


def bars(**materials: mca.Elastic) -> mca.Scene:
    """Bars that fly side by side into a wall, each yielding or not as its material does."""
    box = mca.Box(size=(0.04, 0.01, 0.01), divisions=(16, 2, 2))  # as many elements as lanes take
    wall = mca.RigidPlane(point=(0.04, 0.0, 0.0), normal=(-1.0, 0.0, 0.0))
    return mca.Scene(
        name="bars",
        bodies=tuple(
            mca.Body(name=name, geometry=box, material=m, position=(0.0, 0.0, 0.03 * k), velocity=(12.0, 0.0, 0.0))
            for k, (name, m) in enumerate(materials.items())
        ),
        contacts=tuple(
            mca.Contact(slave=mca.Surface(body=name, nodes="xmax"), master=wall, penalty=1.0) for name in materials
        ),
        paths=tuple(
            mca.Path(
                name=name,
                lines=(mca.Line(body=name, start=(0.0, 0.005, 0.005), end=(0.04, 0.005, 0.005)),),
                spacing=0.005,
            )
            for name in materials
        ),
        impact=mca.ImpactPhase(duration=2e-5, output_interval=1e-6, time_step_scale=0.45),
    )


def test_bars_of_three_materials_each_go_by_their_own():
    """Neither takes a digit from what lies beside it, alone or in a batch, and the balance of energy is kept."""
    one = mca.run(bars(elastic=mca.Elastic(**ELASTIC), metal=METAL))
    both = mca.run(bars(elastic=mca.Elastic(**ELASTIC), metal=METAL, own=VOCE))
    alone = mca.run(bars(own=VOCE))
    assert one.summary["dt"] == both.summary["dt"] == alone.summary["dt"]
    for path, known in zip(both.paths, (*one.paths, *alone.paths), strict=True):
        assert np.array_equal(path.stress, known.stress)
    assert alone["E_plastic"][-1] > 0.7 * alone["E_kinetic"][0] and alone.summary["energy_error"] < 2e-3
    assert alone["E_plastic"][-1] == pytest.approx(both["E_plastic"][-1] - one["E_plastic"][-1], rel=1e-5)
    batch = mca.run_batch([bars(own=mca.Elastic(**ELASTIC)), bars(own=VOCE)])
    assert np.array_equal(batch[1].paths[0].stress, alone.paths[0].stress)
    assert batch[0].summary["max_plastic_strain"] == 0.0


def test_kernels_of_a_gpu_compile_for_it(tmp_path: Path):
    kernel = hex8r_patch.force_kernel("mixed", VOCE.law)
    wp.compile_aot_module(kernel.module, device=None, arch=MIN_ARCH, module_dir=tmp_path, use_ptx=True)
    (source,) = tmp_path.glob("*.ptx")
    assert "ex2.approx" in source.read_text(encoding="utf-8", errors="replace")  # the exponential of the law


@pytest.mark.gpu
@pytest.mark.parametrize("element", ["hex8", "hex8r", "tet4", "tet10"])
def test_device_gives_the_figures_of_the_cpu(element: str):
    scene = bars(metal=METAL, own=VOCE)
    scene = replace(scene, bodies=tuple(replace(body, element=element) for body in scene.bodies))
    cpu, cuda = (mca.run(scene, device=device) for device in ("cpu", "cuda:0"))
    for name in ("F_n_N", "E_kinetic", "E_plastic"):
        assert cuda[name] == pytest.approx(cpu[name], abs=1e-4 * np.abs(cpu[name]).max())


def test_colours_end_at_the_lowest_yield_stress():
    assert ColourScale(bars(metal=replace(METAL, sigma_y=90e6), own=VOCE)).limit == 60e6
    assert not ColourScale(bars(elastic=mca.Elastic(**ELASTIC))).fixed


def test_what_is_not_registered_is_refused():
    @dataclass(frozen=True, kw_only=True)
    class Softer(Voce):
        pass

    with pytest.raises(RequestError, match=r"give an Elastic or a J2Bilinear or a Voce, or .* by warp_mca.register"):
        bars(own=Softer(**vars(VOCE)))


@pytest.mark.parametrize(("law", "words"), [("no_such_law", "No module named 'no_such_law'"), ("math", "no attribute")])
def test_a_law_that_is_none_is_refused(law: str, words: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(Voce, "law", law)
    with pytest.raises(RequestError, match=rf"^law of a material = '{law}': name a module that makes .*{words}[^\n]*$"):
        mca.run(bars(own=VOCE))


def test_a_model_file_holds_the_material_while_it_is_registered(tmp_path):
    scene = bars(own=VOCE)
    scene_file.save(tmp_path / "bars.mca", scene, mca.mesh(scene))
    assert scene_file.load(tmp_path / "bars.mca").scene.bodies[-1].material == VOCE
    del MATERIALS["Voce"]
    with pytest.raises(RequestError, match="scene = 'Voce': a model file holds warp_mca's own classes"):
        scene_file.save(tmp_path / "other.mca", scene, mca.mesh(scene))
    assert not (tmp_path / "other.mca").exists()
