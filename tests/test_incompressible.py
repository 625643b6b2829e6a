"""`hex8i` near incompressibility at finite strain: forces are the slope of its energy, and runs stay stable."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from test_elements import energy, held_of, settled

import warp_mca as mca

SOFT = {"E": 3e6, "nu": 0.499, "rho": 1100.0}


@pytest.mark.parametrize("material", [mca.Elastic(**SOFT), mca.NeoHookean(C10=5e5, nu=0.499, rho=1100.0)])
def test_forces_are_the_slope_of_the_energy(material: mca.Elastic):
    """With the part of the pressure that points share."""
    rng = np.random.default_rng(0)
    box = mca.Box(size=(1.0, 0.8, 1.2), divisions=(1, 1, 1)).build()
    mesh = dataclasses.replace(box, points=box.points + rng.uniform(-0.06, 0.06, box.points.shape))
    held = held_of(mesh, "hex8i", "finite", material=material)
    u = mesh.points @ rng.uniform(-0.05, 0.05, (3, 3)) + 0.015 * rng.uniform(-1, 1, mesh.points.shape)
    force, h = settled(held, u), 1e-7
    for way in rng.normal(size=(3, *u.shape)):
        slope = (energy(held, u + h * way) - energy(held, u - h * way)) / (2.0 * h)
        assert -(force * way).sum() == pytest.approx(slope, rel=1e-5, abs=1e-5 * np.abs(force).max())


def pulled(element: str, way: float, axis: str, device: str = "cpu") -> mca.Result:
    """A strip, both ends of which are held and one driven; its output is one of energy."""
    strip = mca.Box(size=(0.03, 0.01, 0.01), divisions=(6, 2, 2))
    body = mca.Body(name="strip", geometry=strip, material=mca.Elastic(**SOFT), kinematics="finite", element=element)
    ends = {"body": "strip", "nodes": "xmax", "times": (0.0, 5e-3)}
    drives = tuple(mca.Prescribed(**ends, axis=a, displacements=(0.0, way if a == axis else 0.0)) for a in "xyz")
    held = mca.Fixed(body="strip", nodes="xmin")
    impact = mca.ImpactPhase(duration=5e-3, output_interval=5e-5)
    scene = mca.Scene(name="pulled", bodies=(body,), fixed=(held,), prescribed=drives, impact=impact)
    return mca.run(scene, device=device)


@pytest.mark.parametrize(("way", "axis", "closeness"), [(0.03, "x", 0.2), (0.02, "z", 0.12), (0.01, "z", 0.06)])
def test_a_strip_is_stretched_and_sheared(way: float, axis: str, closeness: float):
    """To twice its length, where vectors have faded; it was stopped there. Work is about that of `hex8`."""
    found, plain = (pulled(element, way, axis).summary for element in ("hex8i", "hex8"))
    assert found["energy_error"] < 2e-3
    assert found["energy"]["external_work"] == pytest.approx(plain["energy"]["external_work"], rel=closeness)


def pressed(element: str, way: float) -> dict[str, float]:
    """Energies of a block between bonded plates, pressed by a way [m]."""
    block = mca.Box(size=(0.02, 0.01, 0.02), divisions=(6, 3, 6))
    rubber = mca.Elastic(E=1e6, nu=0.48, rho=1000.0)
    body = mca.Body(name="block", geometry=block, material=rubber, kinematics="finite", element=element)
    held = (mca.Fixed(body="block", nodes="ymin"), mca.Fixed(body="block", nodes="ymax", axes="xz"))
    times, share = np.linspace(0.0, 0.01, 11), np.linspace(0.0, 1.0, 11)
    way_of = tuple(float(w) for w in -way * share**2 * (3.0 - 2.0 * share))
    drive = mca.Prescribed(body="block", nodes="ymax", axis="y", times=tuple(times), displacements=way_of)
    damped = (mca.Damping(body="block", mass=300.0, about="ground"),)
    impact = mca.ImpactPhase(duration=0.011, output_interval=1e-4)
    scene = mca.Scene(name="pressed", bodies=(body,), fixed=held, prescribed=(drive,), loads=damped, impact=impact)
    found = mca.run(scene, device="cpu").summary
    assert found["energy_error"] < 3e-3
    return found["energy"]


@pytest.mark.parametrize(("way", "closeness"), [(0.003, 0.12), (-0.003, 0.1)])
def test_a_bonded_block_does_not_lock_where_vectors_have_faded(way: float, closeness: float):
    """Its points have less of the bulk modulus to themselves there; with as much as before the force was twice."""
    found, plain = (pressed(element, way) for element in ("hex8i", "hex8"))
    stored = found["elastic"] + found["hourglass"]
    assert stored == pytest.approx(plain["elastic"], rel=closeness)


@pytest.mark.gpu
def test_a_gpu_stretches_a_strip_alike():
    one, other = (pulled("hex8i", 0.02, "x", device).summary["energy"] for device in ("cpu", "cuda:0"))
    assert other["external_work"] == pytest.approx(one["external_work"], rel=1e-4)
    assert abs(other["error"]) < 2e-3 * other["external_work"]
