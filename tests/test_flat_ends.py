"""Flat ends that meet: energy of springs that close and open within steps, forces that ring, bodies that creep."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from impacts import finished, result_of

import warp_mca as mca
from warp_mca.kernels.records.columns import MADE

E, RHO, SIDE = 70e9, 2700.0, 0.01
C = math.sqrt(E / RHO)


def bar(
    cells: tuple[int, int] = (10, 2),
    *,
    element: str = "hex8",
    nu: float = 0.0,
    mu: float = 0.0,
    two_way: bool | None = None,
    penalty: float | None = None,
    gap: float = 0.0,
) -> mca.Scene:
    """A bar ten times as long as wide that flies flat on a plane, or on an equal one at rest if `two_way` is given."""
    along, across = cells
    box = mca.Box(size=(10.0 * SIDE, SIDE, SIDE), divisions=(along, across, across))
    material = mca.Elastic(E=E, nu=nu, rho=RHO)
    other = mca.Body(name="other", geometry=box, material=material, element=element, position=(-10.0 * SIDE, 0.0, 0.0))
    place, velocity = (gap, 0.0, 0.0), (-1.0, 0.4 * mu, 0.0)
    flying = dataclasses.replace(other, name="bar", velocity=velocity, position=place)
    master: mca.RigidPlane | mca.Surface = mca.RigidPlane(normal=(1.0, 0.0, 0.0))
    bodies = [flying]
    if two_way is not None:
        bodies.append(other)
        master = mca.Surface(body="other", nodes="xmax")
    slave = mca.Surface(body="bar", nodes="xmin")
    contact = mca.Contact(slave=slave, master=master, mu=mu, two_way=bool(two_way), penalty=penalty)
    length = 10.0 * SIDE
    impact = mca.ImpactPhase(duration=3.0 * length / C, output_interval=0.05 * length / C)
    return mca.Scene(name="flat bar", bodies=tuple(bodies), contacts=(contact,), impact=impact)


def cube(tolerance: float = 0.01, scale: float = 0.9, penalty: float | None = None) -> mca.Scene:
    """A cube of eight cells that flies flat on a plane."""
    box = mca.Box(size=(0.02, 0.02, 0.02), divisions=(2, 2, 2))
    steel = mca.Elastic(E=200e9, nu=0.0, rho=7800.0)
    body = mca.Body(name="cube", geometry=box, material=steel, velocity=(0.0, 0.0, -2.0))
    bottom, plane = mca.Surface(body="cube", nodes="zmin"), mca.RigidPlane(normal=(0.0, 0.0, 1.0))
    contact = mca.Contact(slave=bottom, master=plane, penalty=penalty)
    impact = mca.ImpactPhase(duration=3e-5, output_interval=1e-6, energy_tolerance=tolerance, time_step_scale=scale)
    return mca.Scene(name="cube", bodies=(body,), contacts=(contact,), impact=impact)


def slope(angle: float, tolerance: float = 0.01, mu: float = 0.4) -> mca.Scene:
    """A soft block that lies on a slope, without the dashpot that its contact would have."""
    plane = mca.RigidPlane(normal=(math.sin(angle), math.cos(angle), 0.0))
    box = mca.Box(size=(0.03, 0.01, 0.02), divisions=(5, 2, 4))
    soft = mca.Elastic(E=5e7, nu=0.3, rho=1200.0)
    block = mca.Body(name="block", geometry=box, material=soft, rotation=(0.0, 0.0, -angle)).place_on(plane)
    return mca.Scene(
        name="slope",
        bodies=(block,),
        gravity=(0.0, -80.0, 0.0),
        contacts=(mca.Contact(slave=mca.Surface(body="block", nodes="ymin"), master=plane, mu=mu, law=mca.Penalty()),),
        impact=mca.ImpactPhase(duration=0.02, output_interval=1e-4, energy_tolerance=tolerance),
        probes=(mca.Probe(name="skin", body="block", nodes="boundary"),),
    )


def imbalance(scene: mca.Scene) -> tuple[np.ndarray, np.ndarray]:
    """Imbalance of each row over the initial energy, and the part of it that contact springs booked [-]."""
    own = finished(scene, precision="float64").scene_runs[0].ledger
    energy = own.energies()
    work = energy.pop("external_work")
    made = own.springs(own.table())[..., MADE].sum(axis=1)
    return (sum(energy.values()) - work) / own.initial_energy - 1.0, (made - made[0]) / own.initial_energy


@pytest.mark.parametrize(
    "given", [{}, {"gap": 1.3e-7}, {"mu": 0.3}, {"two_way": True}, {"two_way": False, "mu": 0.2, "nu": 0.3}]
)
def test_springs_book_what_they_make(given: dict):
    """All of the imbalance: other forces do the work of their energies to the square of a step's strain.

    Those of default stiffness return it.
    """
    assert np.abs(imbalance(bar(**given))[0]).max() < 1e-3
    net, made = imbalance(bar(**given, penalty=0.3))
    assert np.abs(made).max() > 1e-6
    assert np.abs(net - made).max() < 0.01 * np.abs(made).max()


@pytest.mark.parametrize("given", [{}, {"mu": 0.3}, {"nu": 0.3}, {"two_way": True}, {"two_way": False}], ids=str)
def test_energy_does_not_depend_on_where_steps_fall(given: dict):
    """Springs that close and open within steps took or made up to 4.8 %."""
    worst = [np.abs(imbalance(bar(**given, gap=share * 4e-7))[0]).max() for share in (0.1, 0.3, 0.5, 0.7, 0.9)]
    assert max(worst) < 9e-3
    assert np.mean(worst) < 6e-3


def test_a_cube_keeps_its_energy_at_a_flat_end():
    """It ended with 7.3 % more."""
    net, finer = imbalance(cube()), mca.run(cube(scale=0.09))
    result = mca.run(cube())
    assert np.abs(net[0]).max() < 0.015
    assert abs(net[0][-1]) < 3e-3
    assert result.F_n.sum() == pytest.approx(finer.F_n.sum(), rel=0.01)


@pytest.mark.parametrize(("tolerance", "penalty"), [(1e-4, 1.0), (1e-3, 30.0)])
def test_a_stop_names_the_contact_that_made_the_energy(tolerance: float, penalty: float):
    scene = cube(tolerance=tolerance, penalty=penalty)
    says = f"exceeds energy_tolerance = {tolerance:g} of .*, of which contact springs of cube on a plane made"
    with pytest.raises(mca.GuardError, match=says):
        mca.run(scene)


@pytest.mark.parametrize(
    ("scene", "rings"),
    [
        (bar((20, 2), penalty=2.0), True),
        (bar((8, 1), element="tet4", penalty=1.0), True),
        (bar((15, 3), nu=0.3, two_way=True, penalty=1.0), True),
        (bar((15, 3), nu=0.3, two_way=True), False),
        (bar((20, 2), penalty=0.1), False),  # so soft that the force rises slowly
        (dataclasses.replace(bar((20, 2), penalty=2.0), joints=(mca.Weld(name="W", body="bar", nodes="xmax"),)), False),
    ],
)
def test_a_force_above_that_of_waves_is_said_to_ring(scene: mca.Scene, rings: bool):
    """A flat bar presses with rho c v A on a wall, and with half of that on its like, until waves are back."""
    result = mca.run(scene)
    said = [warning for warning in result.warnings if "cells ring" in warning]
    assert len(said) == rings
    if rings:
        pair = len(scene.bodies)
        c = scene.bodies[0].material.wave_speeds["dilatational"]  # type: ignore[union-attr]
        waves = RHO * c * SIDE**2 / pair
        assert f"is {result.summary['F_n_max'] / waves:.2f} times" in said[0]
        inside = (result.time > 0.4 * 10.0 * SIDE / C) & (result.time < 1.6 * 10.0 * SIDE / C)
        assert result.F_n[inside].mean() == pytest.approx(RHO * C * SIDE**2 / pair, rel=0.05)  # as it says


@pytest.mark.parametrize(("angle", "creeps"), [(0.25, True), (0.32, True), (0.5, False), (0.0, False)])
def test_a_block_at_rest_that_creeps_is_said_to(angle: float, creeps: bool):
    """Below the angle of friction, 0.38, it should rest; above it slides, with g (sin - mu cos) t."""
    result = mca.run(slope(angle))
    said = [warning for warning in result.warnings if "creeps at" in warning]
    assert len(said) == creeps
    along = result.probes[0].position @ np.array([math.cos(angle), -math.sin(angle), 0.0])
    half = len(along) // 2
    speed = (along[-1] - along[half]) / (result.time[-1] - result.time[half])
    if creeps:
        assert 1e-5 < speed < 5e-2
        assert float(said[0].split(" creeps at ")[1].split(" m/s")[0]) == pytest.approx(speed, rel=0.3)
        share = float(said[0].split("friction there is ")[1].split("%")[0])
        assert share == pytest.approx(100.0 * math.tan(angle) / 0.4, abs=2.0)
    elif angle:
        expected = 80.0 * (math.sin(angle) - 0.4 * math.cos(angle)) * 0.75 * 0.02
        assert speed == pytest.approx(expected, rel=0.1)


def test_a_block_that_slides_as_it_spins_is_not_said_to_creep():
    """Its friction sums to less than mu F_n, since its nodes slide in unlike directions."""
    flat = slope(0.0)
    block = dataclasses.replace(flat.bodies[0], velocity=(1.0, 0.0, 0.0), angular_velocity=(0.0, 60.0, 0.0))
    result = mca.run(dataclasses.replace(flat, bodies=(block,)))
    assert not any("creep" in warning for warning in result.warnings)


@pytest.mark.parametrize("name", ["sticking_block", "stick_slip"])
def test_built_in_blocks_do_not_creep(name: str):
    result = finished(mca.make_scene(name))
    assert not any("creep" in warning for warning in result_of(result).warnings)


@pytest.mark.parametrize("penalty", [None, "auto"])
@pytest.mark.parametrize("nu", [0.39, 0.49, 0.499])
def test_springs_of_rubber_carry_the_force_of_its_wave(nu: float, penalty: str | None):
    """A block that cannot spread: Z A v for 2 L / c. Springs of E / (1 - nu^2) took half of it at nu = 0.49."""
    rubber = mca.NeoHookean(C10=0.4e6, nu=nu, rho=1100.0)
    G, speed = 0.8e6, 0.5
    c = math.sqrt((2.0 * G * (1.0 + nu) / (3.0 * (1.0 - 2.0 * nu)) + 4.0 * G / 3.0) / 1100.0)
    box = mca.Box(size=(0.02, 0.01, 0.01), divisions=(10, 1, 1))
    pad = mca.Body(
        name="pad", geometry=box, material=rubber, element="hex8", kinematics="finite", velocity=(-speed, 0.0, 0.0)
    )
    slave, wall = mca.Surface(body="pad", nodes="xmin"), mca.RigidPlane(normal=(1.0, 0.0, 0.0))
    scene = mca.Scene(
        name="confined",
        bodies=(pad,),
        contacts=(mca.Contact(slave=slave, master=wall, penalty=penalty),),
        fixed=tuple(mca.Fixed(body="pad", nodes=axis + end, axes=axis) for axis in "yz" for end in ("min", "max")),
        impact=mca.ImpactPhase(duration=0.08 / c, output_interval=1e-3 / c),
    )
    result = mca.run(scene)
    wave = 1100.0 * c * 1e-4 * speed
    assert result.F_n.max() > 0.9 * wave
    if penalty is None:  # "auto" rings, with the same stiffness
        assert result.F_n.max() < 1.1 * wave
        assert result.summary["contact_duration"] == pytest.approx(0.04 / c, rel=0.25)
