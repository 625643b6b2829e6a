"""Rubber, viscoelasticity and foam: laws at a point, in every element and in scenes, and refused without sense."""

import dataclasses
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import warp as wp
from impacts import finished, result_of
from outside import goes_on, holds_up, same, striking
from scipy.linalg import expm
from scipy.optimize import brentq
from test_elements import KINDS, held_of, settled

import warp_mca as mca
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.materials.laws import law_functions
from warp_mca.verify.rubber import FOAM, RUBBERS, VISCOUS, deviator_of, relaxed

TIME = np.linspace(0.0, 20e-3, 8001)


@cache
def course_kernel(precision: str, law: str) -> Any:
    """Kernel: stress of a point in every step of a course of strain; energies at its end."""
    t, functions = scalars(precision), law_functions(law, precision)
    R, mat33, rows = t.real, t.mat33, wp.types.vector(max(1, functions.size), t.real)
    parameters, energies = functions.parameters, functions.energies
    law_stress = functions.deviatoric or functions.stress

    @wp.kernel(enable_backward=False, module="unique")
    def course(
        strain: wp.array(dtype=mat33),
        law: wp.array2d(dtype=R),
        dt: R,
        S_out: wp.array(dtype=mat33),
        energy_out: wp.array(dtype=R),
    ):
        c = parameters(law, 0, R(1.0))
        h = rows()
        for i in range(strain.shape[0]):
            S, h = law_stress(strain[i], h, dt, c)
            S_out[i] = S
        stored, spent = energies(strain[strain.shape[0] - 1], h, c)
        energy_out[0] = stored
        energy_out[1] = spent

    return course


def followed(material: mca.Elastic, strain: np.ndarray, precision: str) -> tuple[np.ndarray, np.ndarray]:
    """Stress [Pa] in each row of a course of strain, and stored and dissipated energy at its end [J/m^3]."""
    t = scalars(precision)
    S = wp.zeros(len(strain), dtype=t.mat33, device="cpu")
    energy = wp.zeros(2, dtype=t.real, device="cpu")
    law = wp.array([[min(value, 1e30) for value in material.parameters]], dtype=t.real, device="cpu")
    inputs = [wp.array(strain, dtype=t.mat33, device="cpu"), law, float(TIME[1])]
    wp.launch(course_kernel(precision, material.law), 1, inputs=inputs, outputs=[S, energy], device="cpu")
    return S.numpy().astype(float), energy.numpy().astype(float)


@cache
def random_course(greatest: float) -> np.ndarray:
    """Strain of random waves of every component, from rest to rest."""
    rng, s = np.random.default_rng(47), TIME / TIME[-1]
    waves = np.array([np.sin(np.pi * k * s) * np.sin(np.pi * s) for k in (1, 2, 3, 5)])
    a = np.einsum("kt,kij->tij", waves, rng.normal(0.0, greatest, (4, 3, 3)))
    return 0.5 * (a + np.swapaxes(a, 1, 2))


def deviator(a: np.ndarray) -> np.ndarray:
    return a - np.trace(a, axis1=1, axis2=2)[:, None, None] / 3.0 * np.eye(3)


@pytest.mark.parametrize("precision", ["mixed", "float64"])
@pytest.mark.parametrize("name", VISCOUS)
def test_random_strain_relaxes_as_integrated(name: str, precision: str):
    """Stored and dissipated energy add up to the work."""
    material = VISCOUS[name]
    strain = random_course(0.1)
    strain = strain if material.k else deviator(strain)
    S = relaxed(deviator_of(material.elastic, deviator(strain)), TIME, material.g, material.tau)
    if material.k:
        trace = material.elastic.bulk_modulus * np.trace(strain, axis1=1, axis2=2)
        S = S + relaxed(trace, TIME, material.k, material.tau)[:, None, None] * np.eye(3)
    found, energy = followed(material, strain, precision)
    assert np.abs(found - S).max() < 1e-4 * np.abs(S).max()
    work = float((0.5 * (S[1:] + S[:-1]) * np.diff(strain, axis=0)).sum())
    assert energy.sum() == pytest.approx(work, rel=1e-3) and energy[1] > 0.8 * work > 0.0


def test_stress_that_rests_falls_to_what_does_not_relax():
    """A step of strain, then three times the longest time: T (1 - sum g (1 - exp(-t / tau)))."""
    material = VISCOUS["elastic"]
    e = np.broadcast_to(0.01 * np.diag([1.0, -0.5, -0.5]), (len(TIME), 3, 3))
    found, energy = followed(material, e, "mixed")
    t = TIME + TIME[1]
    left = 1.0 - sum(
        g * (1.0 - (1.0 - np.exp(-TIME[1] / tau)) / (TIME[1] / tau) * np.exp(-TIME / tau))
        for g, tau in zip(material.g, material.tau, strict=True)
    )
    assert found[:, 0, 0] == pytest.approx(2.0 * material.shear_modulus * 0.01 * left, rel=1e-4)
    stored = material.shear_modulus * 1.5e-4
    gone = sum(g * (1.0 - np.exp(-2.0 * t[-1] / tau)) for g, tau in zip(material.g, material.tau, strict=True))
    assert energy[1] == pytest.approx(stored * gone, rel=3e-2)


@pytest.mark.parametrize("precision", ["mixed", "float64"])
def test_random_strain_of_foam_is_that_of_cut_principal_stresses(precision: str):
    """NumPy cuts the elastic trial, of the plastic strain before, to the curve."""
    strain = random_course(0.15) - 0.4 * np.sin(np.pi * TIME / TIME[-1])[:, None, None] ** 2 * np.eye(3)
    eps_p, crushed, work, before, last = np.zeros((3, 3)), 0.0, 0.0, np.zeros((3, 3)), np.zeros((3, 3))
    exact = np.empty_like(strain)
    for i, e in enumerate(strain):
        value, axes = np.linalg.eigh(FOAM.E * (e - eps_p))
        J = np.exp(np.trace(e))
        crushed = max(crushed, 1.0 - J)
        cut = np.clip(value, -J * np.interp(crushed, FOAM.crush, FOAM.stress), J * FOAM.tension)
        exact[i] = axes @ np.diag(cut) @ axes.T
        eps_p = e - exact[i] / FOAM.E
        work += float((0.5 * (exact[i] + last) * (e - before)).sum())
        before, last = e, exact[i]
    found, energy = followed(FOAM, strain, precision)
    assert crushed > 0.6 and np.abs(found - exact).max() < 1e-3 * np.abs(exact).max()
    assert energy.sum() == pytest.approx(work, rel=2e-3)


@pytest.mark.parametrize("element", [name for name, kind in KINDS if kind == "finite" and name != "hex8w3"])
def test_every_element_has_the_stress_of_a_stretched_rubber(element: str):
    """Forces of a homogeneous stretch are those of the closed form on the faces of a cube."""
    rubber = RUBBERS["neo-Hookean"]
    held = held_of(mca.Box(size=(1.0, 1.0, 1.0), divisions=(1, 1, 1)).build(), element, "finite", material=rubber)
    X = held.solver.model.X
    F = expm(np.array([[0.5, 0.3, 0.1], [0.1, -0.3, 0.2], [0.0, 0.2, -0.18]]))
    force = settled(held, X @ (F - np.eye(3)).T)
    left, stretch, right = np.linalg.svd(F)
    J = float(np.prod(stretch))
    value = 2.0 * rubber.C10 * stretch**2 * J ** (-2.0 / 3.0)
    tau = value - value.mean() + rubber.parameters[0] * np.log(J)
    P = left @ np.diag(tau / stretch) @ right
    for axis in range(3):
        face = np.isclose(X[:, axis], 1.0)
        assert -force[face].sum(axis=0) == pytest.approx(P[:, axis], abs=1e-6 * np.abs(P).max())


BLOCK = mca.Box(size=(0.02, 0.01, 0.01), divisions=(4, 2, 2))
DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)]


def striking_block(element: str, material: mca.Elastic, speed: float = 5.0) -> mca.Scene:
    return striking(BLOCK.build(), material, speed, element=element, kinematics="finite")


@pytest.mark.parametrize("device", DEVICES)
def test_a_block_of_foam_strikes(device: str, tmp_path: Path):
    """Alone, in a batch, from a saved state and with several rates."""
    result = holds_up(striking_block("hex8r", FOAM, 30.0), device, tmp_path, tolerance=1e-3)
    assert result.summary["max_plastic_strain"] > 0.05


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize(
    ("element", "material"), [("hex8r", RUBBERS["Mooney-Rivlin"]), ("tet4", VISCOUS["neo-Hookean"])]
)
def test_a_block_of_rubber_strikes(element: str, material: mca.Elastic, device: str, tmp_path: Path):
    """Alone, in a batch and from a saved state."""
    scene = striking_block(element, material)
    result = result_of(finished(scene, device=device))
    assert result.F_n.max() > 0.0 and result.summary["energy_error"] < 1e-3
    assert (result["E_plastic"][-1] > 0.0) == isinstance(material, mca.Prony)
    goes_on(scene, tmp_path, device)
    assert all(same(other, result) for other in mca.run_batch([scene, scene], device=device))


@pytest.mark.parametrize("name", RUBBERS)
def test_a_load_that_begins_smoothly_is_balanced_from_the_first_row(name: str):
    """Strains far below rounding: energy by differences of stretches from 1 has no digits there."""
    load = mca.Traction(body="block", nodes="zmax", traction=(0.0, 0.0, 1e4), amplitude=mca.Amplitude.smooth_step(2e-3))
    body = mca.Body(name="block", geometry=BLOCK, material=RUBBERS[name], element="hex8", kinematics="finite")
    scene = mca.Scene(
        name="smooth",
        bodies=(body,),
        fixed=(mca.Fixed(body="block", nodes="zmin"),),
        loads=(load,),
        impact=mca.ImpactPhase(duration=2e-4),
    )
    assert mca.run(scene, precision="mixed", device="cpu").summary["energy_error"] < 1e-5


def test_a_stretch_beyond_the_stable_step_is_not_silent():
    """To three times its length within the step of `least_stretch` is stable; with that of the mesh it is stopped."""

    def pulled(least: float) -> mca.Scene:
        rubber = mca.NeoHookean(C10=0.5e6, nu=0.49, rho=1100.0, least_stretch=least)
        body = mca.Body(
            name="b",
            geometry=mca.Box(size=(0.01,) * 3, divisions=(3, 3, 3)),
            material=rubber,
            element="hex8",
            kinematics="finite",
        )
        pull = mca.Prescribed(body="b", nodes="xmax", axis="x", times=(0.0, 20e-3), velocities=(0.0, 3.0))
        impact = mca.ImpactPhase(duration=20e-3, output_interval=1e-3)
        held = mca.Fixed(body="b", nodes="xmin")
        return mca.Scene(name="pulled", bodies=(body,), fixed=(held,), prescribed=(pull,), impact=impact)

    assert mca.run(pulled(0.45)).summary["energy_error"] < 1e-2
    with pytest.raises(mca.GuardError, match="time_step_scale"):
        mca.run(pulled(1.0))


RUBBER: dict[str, Any] = {"rho": 1000.0}
WRONG: list[tuple[type[mca.Elastic], dict, str]] = [
    (mca.NeoHookean, {"C10": -1.0, **RUBBER}, r"^NeoHookean\.C10 = -1\.0: give a finite number above 0"),
    (mca.NeoHookean, {"C10": 1e6, "nu": 0.5, **RUBBER}, r"NeoHookean\.nu = 0\.5: Poisson's ratio must lie"),
    (mca.NeoHookean, {"C10": 1e6, "least_stretch": 2.0, **RUBBER}, "give a stretch from 0.01 to 1"),
    (mca.MooneyRivlin, {"C10": 1e6, "C01": -1.0, **RUBBER}, r"MooneyRivlin\.C01 = -1\.0: give a finite number, 0"),
    (mca.Ogden, {"mu": (1e6,) * 4, "alpha": (2.0,) * 4, **RUBBER}, "give one to three finite numbers"),
    (mca.Ogden, {"mu": (1e6,), "alpha": (2.0, 1.0), **RUBBER}, "give as many exponents as mu has, 1"),
    (mca.Ogden, {"mu": (1e6,), "alpha": (-2.0,), **RUBBER}, "give each the sign of its mu"),
    (mca.Prony, {"elastic": FOAM, "g": (0.5,), "tau": (1.0,)}, r"Prony\.elastic = .*: give an Elastic, NeoHookean"),
    (mca.Prony, {"elastic": RUBBERS["Ogden"], "g": (0.5, 0.5), "tau": (1.0, 2.0)}, "give shares above 0, below 1"),
    (mca.Prony, {"elastic": RUBBERS["Ogden"], "g": (0.5,), "tau": (0.0,)}, "give as many times above 0 s as g has"),
    (mca.Prony, {"elastic": RUBBERS["Ogden"], "g": (0.5,), "tau": (1.0,), "k": (1.0,)}, "give a share of 0 or more"),
    (mca.CrushableFoam, {"E": 1e6, "crush": (0.0, 0.5), "stress": (1e5, 9e5), "tension": 1e5, **RUBBER}, "steepest"),
    (mca.CrushableFoam, {"E": 1e6, "crush": (0.1,), "stress": (1e5,), "tension": 1e5, **RUBBER}, "begin with 0"),
]


@pytest.mark.parametrize(("kind", "values", "words"), WRONG)
def test_values_that_make_no_law_are_refused(kind: type[mca.Elastic], values: dict, words: str):
    with pytest.raises(mca.RequestError, match=words):
        kind(**values)


def test_what_does_not_go_together_is_refused():
    with pytest.raises(mca.RequestError, match=r"kinematics = 'corotational': set kinematics='finite'"):
        mca.Body(name="b", geometry=BLOCK, material=RUBBERS["Ogden"])
    for element, material, words in (
        ("hex8r", VISCOUS["elastic"], r"^Body \w+\.element = 'hex8r': its hourglass stiffness does not relax"),
        ("tet4", FOAM, r"^Body \w+\.element = 'tet4': .*; choose tet10$"),
    ):
        with pytest.raises(mca.RequestError, match=words):
            mca.run(striking_block(element, material), device="cpu")


def test_moduli_are_those_of_small_strain_and_survive_a_change():
    rubber = mca.Ogden(mu=(0.63e6, 0.0012e6, -0.01e6), alpha=(1.3, 5.0, -2.0), rho=1100.0, nu=0.49)
    G = 0.5 * (0.63e6 * 1.3 + 0.0012e6 * 5.0 + 0.01e6 * 2.0)
    assert pytest.approx((2.0 * G * 1.49, G)) == (rubber.E, rubber.parameters[1])
    assert rubber.shear_modulus == pytest.approx(G / 0.49)
    heavier = dataclasses.replace(mca.Prony(elastic=rubber, g=(0.2,), tau=(1e-3,)), g=(0.3,))
    assert heavier.E == rubber.E and heavier.rho == rubber.rho


@pytest.mark.parametrize("given", [{"rigid": True}, {}, {"material": mca.Elastic(E=4e5, nu=0.3, rho=1000.0)}])
def test_strain_of_rubber_is_not_put_on_what_it_strikes(given: dict):
    """A warning that a body of small strain reached a strain of 0.3, which was in the rubber, also of rigid bodies."""
    rubber, steel = mca.NeoHookean(C10=0.4e6, nu=0.3, rho=1100.0), mca.Elastic(E=210e9, nu=0.3, rho=7850.0)
    cube = mca.Box(size=(0.01, 0.01, 0.01), divisions=(2, 2, 2))
    common = {"geometry": cube, "element": "hex8"}
    pad = mca.Body(name="pad", material=rubber, kinematics="finite", velocity=(0.0, -8.0, 0.0), **common)
    base = mca.Body(name="base", position=(0.0, -0.01, 0.0), **common | {"material": steel} | given)
    slave, master = mca.Surface(body="pad", nodes="ymin"), mca.Surface(body="base", nodes="ymax")
    scene = mca.Scene(
        name="pad on a base",
        bodies=(pad, base),
        contacts=(mca.Contact(slave=slave, master=master, two_way=True),),
        impact=mca.ImpactPhase(duration=6e-4, output_interval=6e-6, energy_tolerance=1.0),
    )
    result = mca.run(scene)
    said = [text for text in result.warnings if "strains as small" in text]
    assert result.summary["max_strain"] > 0.1
    assert len(said) == ("material" in given) and all("if that was in base" in text for text in said)


@pytest.mark.parametrize(("element", "nu", "n"), [("hex8r", 0.3, 2), ("tet10_mean", 0.45, 2), ("hex8", 0.45, 5)])
def test_rubber_that_buckles_as_it_is_pressed_is_told(element: str, nu: float, n: int):
    """A block folds on its way to 0.4 of its length; one that is pressed to 0.5 is right, and silent."""
    rubber = mca.Ogden(mu=(0.63e6, 0.0012e6, -0.01e6), alpha=(1.3, 5.0, -2.0), nu=nu, rho=1100.0, least_stretch=0.34)
    told = []
    for stretch in (0.4, 0.5):
        block = mca.Box(size=(0.02, 0.02, 0.02), divisions=(n, n, n))
        body = mca.Body(name="block", geometry=block, material=rubber, element=element, kinematics="finite")
        way = (0.0, (stretch - 1.0) * 0.02, (stretch - 1.0) * 0.02)
        press = mca.Prescribed(body="block", nodes="xmax", axis="x", times=(0.0, 0.04, 0.06), displacements=way)
        scene = mca.Scene(
            name="block",
            bodies=(body,),
            fixed=tuple(mca.Fixed(body="block", nodes=f"{axis}min", axes=axis) for axis in "xyz"),
            prescribed=(press,),
            loads=(mca.Damping(body="block", mass=400.0, about="ground"),),
            impact=mca.ImpactPhase(duration=0.06, output_interval=1e-3),
        )
        told.append(any("folded" in warning for warning in mca.run(scene, device="cpu", figures="none").warnings))
    assert told == [True, False]


RUBBER = mca.NeoHookean(C10=0.4e6, nu=0.45, rho=1100.0)


def flush(first: mca.Elastic, side: float, stretch: float, **contact: Any) -> mca.Scene:
    """A block of rubber, and one of `first` in front of it, pressed to a share of their length of two half cubes."""
    end, half = 0.04, mca.Box(size=(side / 2, side, side), divisions=(2, 4, 4))
    bodies = [
        mca.Body(
            name=name,
            geometry=half,
            material=material,
            element="hex8",
            kinematics="finite" if material is RUBBER else "corotational",
            position=(x, 0.0, 0.0),
        )
        for name, material, x in (("a", RUBBER, 0.0), ("b", first, side / 2))
    ]
    way = (0.0, (stretch - 1.0) * side, (stretch - 1.0) * side)
    between = mca.Contact(
        slave=mca.Surface(body="a", nodes="xmax"), master=mca.Surface(body="b", nodes="xmin"), **contact
    )
    return mca.Scene(
        name="flush",
        bodies=bodies,
        fixed=[mca.Fixed(body=name, nodes=f"{axis}min", axes=axis) for name, axis in ("ax", "ay", "az", "by", "bz")],
        contacts=[between],
        prescribed=[mca.Prescribed(body="b", nodes="xmax", axis="x", times=(0.0, end, 1.5 * end), displacements=way)],
        loads=[mca.Damping(body=name, mass=400.0, about="ground") for name in "ab"],
        impact=mca.ImpactPhase(duration=1.5 * end, output_interval=1e-4),
    )


def pressed(stretch: float) -> float:
    """Nominal stress [Pa] of RUBBER pressed without friction."""
    C10, nu = RUBBER.C10, RUBBER.nu

    def across(t: float) -> float:  # Kirchhoff stress where both stretches across are t
        J = stretch * t * t
        deviator = 2.0 / 3.0 * C10 * J ** (-2.0 / 3.0) * (t * t - stretch**2)
        return deviator + 4.0 / 3.0 * C10 * (1.0 + nu) / (1.0 - 2.0 * nu) * np.log(J)

    t = brentq(across, 1.0, 1.3)
    along = 2.0 * C10 * (stretch * t * t) ** (-2.0 / 3.0) * (stretch**2 - t * t)  # Kirchhoff stress less that across
    return -along / stretch


def test_blocks_of_rubber_that_lie_on_each_other_stay_flush():
    """Pressed to 0.8 of their length without friction they have the force of one block, with no stress across."""
    result = mca.run(flush(RUBBER, 0.02, 0.8, penalty=10.0), device="cpu", figures="none")
    assert result.F_n[-1] == pytest.approx(pressed(0.8) * 0.02**2, rel=1e-2)


def test_a_stop_where_rubber_slides_over_an_edge_says_what_lets_it_run():
    """Springs of flat contacts are soft, and go where nodes of rubber pass the edge of a flush stiff block."""
    stiff = mca.Elastic(E=70e9, nu=0.33, rho=27000.0)
    says = r"contact springs of a on b lost .* J: raise its penalty, as to 10 and give two_way=True"
    with pytest.raises(mca.GuardError, match=says):
        mca.run(flush(stiff, 0.02, 0.9, penalty=0.3, two_way=False), device="cpu", figures="none")
    soft = mca.run(flush(stiff, 0.02, 0.9), device="cpu", figures="none")
    assert any("% below that of stiff springs" in text for text in soft.warnings)
    result = mca.run(flush(stiff, 0.02, 0.9, penalty=10.0, two_way=True), device="cpu", figures="none")
    assert result.F_n[-1] == pytest.approx(pressed(0.8) * 0.02**2, rel=3e-2)
