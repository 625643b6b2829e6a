"""Values that say that another unit was meant are named with the likely one; extreme but right ones are not."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

import warp_mca as mca
from warp_mca.scene.catalogue import scene_names

STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}
ON_PLANE = mca.Contact(slave=mca.Surface(body="a", nodes="ymin"), master=mca.RigidPlane())


def warned(scene: mca.Scene) -> list[str]:
    return list(mca.quality_table(scene, mca.mesh(scene)).warnings)


def block(material: dict[str, float] = STEEL, size: Any = (0.04, 0.02, 0.02), **options: Any) -> mca.Scene:
    kind = mca.J2Bilinear if "sigma_y" in material else mca.Elastic
    body = {key: options.pop(key) for key in ("rotation", "velocity", "rigid") if key in options}
    geometry = mca.Box(size=size, divisions=(2, 1, 1)) if isinstance(size, tuple) else size
    return mca.Scene(
        name="units",
        bodies=(mca.Body(name="a", geometry=geometry, material=kind(**material), **body),),
        impact=mca.ImpactPhase(duration=1e-5),
        **options,
    )


@pytest.mark.parametrize(
    ("E", "rho", "said"),
    [
        (210e3, 7850.0, "5.17 m/s; solids have 20 to 30,000 m/s and 0.1 to 30,000 kg/m^3: if E is in MPa, give"),
        (70.0, 2700.0, "0.161 m/s; .*: if E is in GPa or MPa, give it in Pa"),
        (1.0, 1100.0, "if E is in GPa or MPa"),
        (210e9, 7.85, "if rho is in g/cm^3, give it in kg/m^3"),
        (69e9, 2.7, "if rho is in g/cm^3"),
        (210e9, 7.85e-9, "if rho is in tonne/mm^3"),
        (3e9, 1.2e-6, "if rho is in kg/mm^3"),
        (206e9, 0.2836, "if rho is in lb/in^3"),
        (210e9, 7.85e6, "if rho is in g/m^3"),
        (210e3, 7.85e-9, "if E is in MPa and rho in tonne/mm^3, give them in Pa and kg/m^3, and lengths in m"),
        (210.0, 7.85e-6, "if E is in GPa and rho in kg/mm^3"),
        (210.0, 7.85, "if E is in GPa and rho in g/cm^3"),
        (210e9, 5e4, "check E"),
    ],
)
def test_the_likely_unit_of_stiffness_and_density_is_named(E: float, rho: float, said: str):
    (sentence,) = warned(block({"E": E, "nu": 0.3, "rho": rho}))
    assert sentence.startswith(f"body a: E = {E:.4g} Pa and rho = {rho:.4g} kg/m^3 give a bar wave speed of")
    parts = said.split(".*")
    assert all(part in sentence for part in parts), sentence


@pytest.mark.parametrize(
    "material",
    [
        STEEL,
        {"E": 1e6, "nu": 0.49, "rho": 1000.0},  # rubber, 31 m/s
        {"E": 2e5, "nu": 0.49, "rho": 1100.0},  # softer rubber, 13 m/s
        {"E": 1e5, "nu": 0.0, "rho": 100.0},  # soft foam
        {"E": 1e4, "nu": 0.2, "rho": 1.0},  # aerogel
        {"E": 1.1e12, "nu": 0.07, "rho": 3520.0},  # diamond, 17.7 km/s
        {"E": 560e9, "nu": 0.25, "rho": 22_600.0},  # osmium
        {"E": 1.0, "nu": 0.0, "rho": 1.0},  # no units
        {**STEEL, "sigma_y": 1e300, "E_t": 0.0},  # never yields
        {"E": 120e9, "nu": 0.3, "rho": 8930.0, "sigma_y": 5e5, "E_t": 0.0},  # a pure single crystal
    ],
)
def test_extreme_solids_are_none_of_these(material: dict[str, float]):
    assert warned(block(material)) == []
    assert warned(block(material, rigid=True)) == []


def test_bodies_of_a_material_are_named_together_and_a_rigid_one_may_be_light():
    soft, light = {"E": 210e3, "nu": 0.3, "rho": 7850.0}, {"E": 210e9, "nu": 0.3, "rho": 8.0}
    first = block(soft)
    other = replace(first.bodies[0], name="b", position=(1.0, 0.0, 0.0))
    (sentence,) = warned(replace(first, bodies=(*first.bodies, other)))
    assert sentence.startswith("bodies a, b: E = 2.1e+05 Pa")
    assert warned(block(light, rigid=True)) == [] and len(warned(block(soft, rigid=True))) == 1


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"material": {**STEEL, "sigma_y": 355.0, "E_t": 2e9}}, "sigma_y = 355 Pa is 1.7e-09 of E: if it is in MPa"),
        ({"size": (200.0, 10.0, 10.0)}, "body a is 200 m long and weighs 1.57e+08 kg: if its sizes are in millimetres"),
        ({"size": (2000.0, 1.0, 1e-3)}, "body a is 2e+03 m long"),
        ({"size": (2e-8, 1e-8, 1e-8)}, "smaller than a tenth of a micrometre"),
        ({"size": mca.Box(size=(40.0, 2.0, 2.0), divisions=(4, 1, 1)).build()}, "if its sizes are in millimetres"),
        ({"rotation": (0.0, 0.0, 90.0)}, r"Body a.rotation = (0, 0, 90) rad is more than a full turn: if it is in "
         "degrees, give (0, 0, 1.571)"),
        ({"rotation": (45.0, -30.0, 0.0)}, "give (0.7854, -0.5236, 0)"),
        ({"gravity": (0.0, -9810.0, 0.0), "size": (40.0, 0.01, 0.01)}, "Scene.gravity = (0, -9810, 0) m/s^2 is 1000 g"),
        ({"contacts": (replace(ON_PLANE, penalty=2.1e11),)}, "the contact of a has penalty = 2.1e+11: it is a factor"),
        ({"contacts": (ON_PLANE,), "velocity": (0.0, -20e3, 0.0)}, "a meet at 2e+04 m/s, faster than the 5172 m/s"),
    ],
)  # fmt: skip
def test_other_values_that_say_another_unit(options: dict[str, Any], said: str):
    (sentence,) = warned(block(**options))
    assert said in sentence


@pytest.mark.parametrize(
    "options",
    [
        {"rotation": (0.0, 0.0, 6.2831853071795864)},
        {"gravity": (0.0, -9806.65, 0.0)},  # a shock of 1000 g
        {"size": (30.0, 0.1, 0.1)},  # a long bar
        {"size": mca.Box(size=(12.0, 1.0, 1.0), divisions=(4, 1, 1)).build()},  # whose mesh comes from no file
        {"size": (2e-6, 1e-6, 1e-6)},
        {"contacts": (ON_PLANE,), "velocity": (20e3, -10.0, 0.0)},  # along the plane
        {"contacts": (replace(ON_PLANE, penalty=1000.0),), "velocity": (0.0, -4000.0, 0.0)},
    ],
)
def test_right_values_pass(options: dict[str, Any]):
    assert warned(block(**options)) == []


def test_angles_of_links_in_degrees_are_named():
    scene = mca.make_scene("two_link")
    assert scene.rigid
    (sentence,) = [
        said for said in warned(replace(scene, rigid=replace(scene.rigid, theta=(90.0, 45.0)))) if "turn" in said
    ]
    assert "RigidPhase.theta = (90, 45) rad is more than a full turn" in sentence and "(1.571, 0.7854)" in sentence


@pytest.mark.parametrize("name", scene_names())
def test_built_in_scenes_have_their_units(name: str):
    assert warned(mca.make_scene(name)) == []
