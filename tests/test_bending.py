"""What runs say of cells that do not bend right: sign and size of the error, and nothing where bodies bend right."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest
from impacts import Displaced
from scipy.spatial.transform import Rotation

import warp_mca as mca
from warp_mca.cli.main import main
from warp_mca.geometry.degenerate import stored, tetrahedral
from warp_mca.geometry.mesh import Mesh
from warp_mca.model.build import build_model
from warp_mca.step.solver import Solver
from warp_mca.system.model import Model
from warp_mca.verify.case import Setup
from warp_mca.verify.limits import METAL, SIGMA_Y
from warp_mca.verify.small_meshes import brick
from warp_mca.verify.statics import Statics
from warp_mca.watch.bending import bending_flow, samples_of, seen
from warp_mca.watch.bent_cells import COLUMNS, FLOW, FLOWING, MISSED, RIGHT, SPENT
from warp_mca.watch.bent_hexahedra import DEEP
from warp_mca.watch.bent_scenes import Together

CUTS = {  # of a hexahedron into two wedges, whose axes go along its edges
    "along": ((0, 3, 7, 1, 2, 6), (0, 7, 4, 1, 6, 5)),
    "across": ((0, 5, 1, 3, 6, 2), (0, 4, 5, 3, 7, 6)),
    "deep": ((0, 1, 2, 4, 5, 6), (0, 2, 3, 4, 6, 7)),
}


def grid(size, cells, kind: str = "", shake: float = 0.0) -> Mesh:
    """A box with its corner at the origin, of hexahedra, of wedges (a key of CUTS) or of tetrahedra ("tet")."""
    mesh = mca.Box(size=size, divisions=cells).build()
    points = mesh.points - mesh.points.min(axis=0)
    inner = (points > 1e-9) & (points < np.array(size) - 1e-9)
    points = points + shake * np.random.default_rng(5).uniform(-1, 1, points.shape) * inner * np.divide(size, cells)
    mesh = dataclasses.replace(mesh, points=points)
    if kind == "tet":
        return tetrahedral(mesh)
    if kind:
        halves = np.concatenate([mesh.hexahedra[:, cut] for cut in CUTS[kind]])
        return dataclasses.replace(mesh, hexahedra=stored(points, halves, "wedge"), cell_sets={})
    return mesh


def sagging(mesh: Mesh, nu: float, element: str = "hex8", load: float = 1e-3, **metal) -> tuple[float, mca.Result]:
    """A cantilever along x that sags from rest along its thinner side, and its greatest deflection over the exact one.

    `load`: strain of its surface at its foot when it hangs at rest, half of the greatest one.
    """
    L, B, H = (float(s) for s in np.ptp(mesh.points, axis=0))
    way, (H, B) = (2, (H, B)) if H < B else (1, (B, H))
    E, rho, G = 70e9, 2700.0, 70e9 / (2.0 + 2.0 * nu)
    g = load * E * H / (3.0 * rho * L**2)
    exact = 2.0 * rho * g * (12.0 * L**4 / (8.0 * E * H**2) + 0.6 * L**2 / G)
    material = mca.J2Bilinear(E=E, nu=nu, rho=rho, **metal) if metal else mca.Elastic(E=E, nu=nu, rho=rho)
    period = 1.787 * L**2 / H * np.sqrt(12.0 * rho / E)  # of bending, 2 pi / 1.875^2
    scene = mca.Scene(
        name="strip",
        bodies=(mca.Body(name="strip", geometry=mesh, material=material, element=element),),
        fixed=(mca.Fixed(body="strip", nodes="xmin"),),
        gravity=(0.0, -g * (way == 1), -g * (way == 2)),
        impact=mca.ImpactPhase(duration=0.9 * period, output_interval=period / 128.0),
        probes=(mca.Probe(name="tip", body="strip", nodes="xmax"),),
    )
    result = mca.run(scene)
    way_of_tip = result.probes[0].position[:, way]
    return float((way_of_tip[0] - way_of_tip.min()) / exact), result


def told(result: mca.Result) -> float:
    """Deflection over the right one that the warning of bending gives; 1 without."""
    (text,) = [w for w in result.warnings if "in bending, its deflections" in w] or ["about 0% too large flexible"]
    share, way = re.findall(r"about (\d+)% too (large|small)", text)[0]
    assert ("flexible" in text) == (way == "large") and ("stiff" in text) == (way == "small")
    return 1.0 + (1 if way == "large" else -1) * int(share) / 100.0


STRIPS = {  # size, cells, nu, element, cut: the error goes from -85 to +160 %
    "short": ((0.04, 0.006, 0.002), (40, 6, 1), 0.3, "hex8", ""),
    "square": ((0.04, 0.004, 0.002), (20, 2, 1), 0.0, "hex8", ""),
    "rubber": ((0.02, 0.004, 0.002), (24, 4, 1), 0.49, "hex8", ""),
    "long": ((0.04, 0.004, 0.002), (5, 1, 1), 0.45, "hex8", ""),
    "two layers": ((0.03, 0.003, 0.002), (45, 4, 2), 0.1, "hex8", ""),
    "three long layers": ((0.04, 0.004, 0.002), (14, 1, 3), 0.3, "hex8", ""),
    "other way": ((0.03, 0.0015, 0.003), (10, 1, 1), 0.3, "hex8", ""),
    "distorted": ((0.04, 0.004, 0.002), (20, 2, 1), 0.4, "hex8", "shaken"),
    "wedges, deep": ((0.04, 0.004, 0.002), (30, 3, 1), 0.3, "hex8", "deep"),
    "wedges, across": ((0.04, 0.004, 0.002), (20, 2, 2), 0.3, "hex8", "across"),
    "wedges, along": ((0.04, 0.004, 0.002), (12, 2, 1), 0.3, "hex8", "along"),
    "own wedges, across": ((0.04, 0.004, 0.002), (20, 2, 2), 0.3, "wedge6", "across"),
    "own wedges, across, longer": ((0.04, 0.004, 0.002), (20, 2, 1), 0.0, "wedge6", "across"),
    "one point, deep": ((0.04, 0.004, 0.002), (20, 4, 1), 0.3, "hex8r", "deep"),
    "one point, along": ((0.04, 0.004, 0.002), (12, 2, 1), 0.4, "hex8r", "along"),
    "tetrahedra": ((0.04, 0.004, 0.002), (20, 2, 2), 0.3, "tet4", "tet"),
    "more tetrahedra": ((0.016, 0.003, 0.002), (20, 3, 3), 0.3, "tet4", "tet"),
}


@pytest.mark.parametrize("case", STRIPS)
def test_the_warning_has_sign_and_size_of_the_error(case: str):
    size, cells, nu, element, cut = STRIPS[case]
    mesh = grid(size, cells, "" if cut == "shaken" else cut, 0.2 if cut == "shaken" else 0.0)
    ratio, result = sagging(mesh, nu, element)
    assert abs(ratio - 1.0) > 0.03
    assert (told(result) > 1.0) == (ratio > 1.0)
    assert told(result) == pytest.approx(ratio, rel=0.35 if element == "tet4" or cut in CUTS else 0.12)
    remedy = {"tet4": "choose tet10", "wedge6": "let axes of wedges go through the wall"}.get(element, "choose hex8i")
    assert any(remedy in text for text in result.warnings)


@pytest.mark.parametrize(
    ("cells", "lean", "element"),
    [
        ((20, 2, 1), 0.2, "hex8i"),
        ((20, 2, 1), 0.4, "hex8i"),
        ((20, 2, 1), 0.4, "hex8r"),
        ((20, 2, 2), 0.4, "hex8w"),
        ((10, 1, 1), 0.2, "hex8w3"),
    ],
)
def test_sides_that_lean_across_the_wall_in_turn(cells, lean: float, element: str):
    """Top and bottom of the strip move by `lean` half depths along it, every second section the other way."""
    mesh = grid((0.04, 0.004, 0.002), cells)
    x, y, z = mesh.points.T
    inner = (x > 1e-9) & (x < 0.04 - 1e-9)
    way = np.where(np.rint(x / 0.04 * cells[0]) % 2 == 0, 1.0, -1.0)
    points = np.column_stack([x + inner * way * lean * (z - 0.001), y, z])
    ratio, result = sagging(dataclasses.replace(mesh, points=points), 0.3, element)
    assert ratio < 0.97
    assert told(result) == pytest.approx(ratio, rel=0.15)
    assert any("let the sides of cells go straight through the wall" in text for text in result.warnings)


@pytest.mark.parametrize(
    ("size", "cells", "element"),
    [
        ((0.04, 0.004, 0.002), (20, 2, 1), "hex8r"),
        ((0.04, 0.004, 0.002), (6, 1, 1), "hex8r"),
        ((0.03, 0.004, 0.0039), (36, 5, 5), "hex8"),
        ((0.04, 0.004, 0.002), (20, 2, 1), "wedge6"),
        ((0.04, 0.004, 0.002), (6, 1, 1), "hex8i"),
        ((0.04, 0.004, 0.002), (6, 1, 1), "hex8w"),
    ],
)
def test_nothing_is_said_of_a_strip_that_bends_right(size, cells, element: str):
    ratio, result = sagging(grid(size, cells, "deep" if element == "wedge6" else ""), 0.3, element)
    assert ratio == pytest.approx(1.0, abs=0.03)
    assert not [text for text in result.warnings if "bending" in text]


def test_nothing_is_said_of_squeezed_rubber():
    """Between rough plates its strain varies over single cells, too, but it is not bent."""
    rubber = mca.Elastic(E=1e6, nu=0.499, rho=1000.0)
    body = mca.Body(name="it", geometry=grid((0.02, 0.02, 0.02), (4, 4, 4)), material=rubber)
    press = {"body": "it", "nodes": "zmax", "times": (0.0, 4e-3)}
    scene = mca.Scene(
        name="press",
        bodies=(body,),
        fixed=(mca.Fixed(body="it", nodes="zmin"), mca.Fixed(body="it", nodes="zmax", axes="xy")),
        prescribed=(mca.Prescribed(axis="z", velocities=(-0.05, -0.05), **press),),
        impact=mca.ImpactPhase(duration=4e-3, output_interval=1e-4),
    )
    assert not [text for text in mca.run(scene, precision="float64").warnings if "bending" in text]


@pytest.mark.parametrize("kind", ["", "deep", "tet"])
@pytest.mark.parametrize(("spin", "gravity"), [((0.0, 0.0, 0.0), -9.81), ((30.0, 0.0, 90.0), 0.0)])
def test_nothing_is_said_of_bodies_in_flight(kind: str, spin, gravity: float):
    steel = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)
    mesh = grid((0.1, 0.02, 0.01), (4, 1, 1), kind)
    body = mca.Body(name="it", geometry=mesh, material=steel, velocity=(0.0, 20.0, 1.0), angular_velocity=spin)
    flight = mca.ImpactPhase(duration=2e-3, output_interval=1e-4)
    result = mca.run(mca.Scene(name="flight", bodies=(body,), gravity=(0.0, gravity, 0.0), impact=flight))
    assert not [text for text in result.warnings if "bending" in text]


def model_of(mesh: Mesh, material, element: str) -> Model:
    scene = mca.Scene(
        name="one",
        bodies=(mca.Body(name="it", geometry=mesh, material=material, element=element),),
        impact=mca.ImpactPhase(duration=1e-6),
    )
    X = mca.mesh(scene)["it"].points
    return build_model(scene, mca.mesh(scene), {"it": X}, {"it": np.zeros_like(X)})


@pytest.mark.parametrize(
    ("element", "kind"), [("tet4", "tet"), ("hex8", "deep"), ("hex8", "along"), ("hex8r", "deep"), ("hex8r", "across")]
)
def test_energy_spent_is_that_of_the_element(element: str, kind: str):
    """Also in bodies that have turned far."""
    mesh = grid((0.3, 0.2, 0.2), (2, 2, 1), kind)
    model = model_of(mesh, mca.Elastic(E=3e9, nu=0.4, rho=1000.0), element)
    rng = np.random.default_rng(2)
    u = 1e-5 * rng.uniform(-1.0, 1.0, model.X.shape)
    turn = Rotation.from_rotvec([0.7, -1.9, 0.4]).as_matrix()
    u = (model.X + u) @ turn.T - model.X
    held = Displaced(Solver(model, device="cpu", precision="float64", dt=1e-9))
    held.forces(u)
    expected = float(held.energies()[[0, 4]].sum())
    (sums,) = seen(model, samples_of(model), u, np.zeros((0, 6)))
    assert sums[SPENT] == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("element", ["hex8", "hex8i", "hex8r", "tet4"])
def test_scenes_that_are_looked_at_together_have_what_each_has_alone(element: str):
    """Of two meshes and materials, one of which yields, one scene without numbers, and one that held more before."""
    sizes = [(0.3, 0.2, 0.2), (0.35, 0.2, 0.1), (0.3, 0.2, 0.2), (0.3, 0.2, 0.2)]
    kind = "tet" if element == "tet4" else "deep"
    soft = dataclasses.replace(METAL, sigma_y=1e-4 * METAL.E)
    metals = (METAL, METAL, soft, METAL)
    models = [model_of(grid(s, (2, 2, 1), kind), m, element) for s, m in zip(sizes, metals, strict=True)]
    u = [1e-4 * np.random.default_rng(k).uniform(-1.0, 1.0, model.X.shape) for k, model in enumerate(models)]
    u[3][0] = np.nan
    before = [np.zeros((0, COLUMNS)), np.full((1, COLUMNS), 1e30), np.zeros((1, COLUMNS)), np.ones((1, COLUMNS))]
    scenes = [(model, samples_of(model)) for model in models]
    found = Together(scenes).seen(np.concatenate(u), before)
    for (model, samples), own, old, new in zip(scenes, u, before, found, strict=True):
        np.testing.assert_allclose(new, seen(model, samples, own, old), rtol=1e-12)
    assert found[0][0, SPENT] > 0.0 and found[1][0, SPENT] == 1e30 and (found[3] == 1.0).all()


def bent(model: Model, curvature: float, across: float) -> np.ndarray:
    """Displacements of one brick that is bent about its width, u_x = -k x z, and across, u_y = -across k y z."""
    x, y, z = (model.X - model.X.mean(axis=0)).T
    u = np.zeros_like(model.X)
    u[:, 0], u[:, 1] = -curvature * x * z, -across * curvature * y * z
    return u


@pytest.mark.parametrize(
    ("long", "wide", "nu"), [(0.5, 0.25, 0.3), (1.0, 1.0, 0.0), (3.0, 0.5, 0.45), (8.0, 2.0, 0.499)]
)
def test_a_brick_that_bends_freely(long: float, wide: float, nu: float):
    """Stiffness of hex8 over E: what is left by the strain across that takes no force, of its own and of the shear."""
    model = model_of(grid((long, wide, 1.0), (1, 1, 1)), mca.Elastic(E=1e9, nu=nu, rho=1000.0), "hex8")
    own, side = 4.0 / 3.0 + long**2, 4.0 / 3.0 + wide**2
    stiffness = (own - (2.0 / 3.0) ** 2 / side) / (2.0 * (1.0 + nu))
    (sums,) = seen(model, samples_of(model), bent(model, 1e-6, 2.0 / 3.0 / side), np.zeros((0, 6)))
    assert sums[RIGHT] / sums[SPENT] == pytest.approx(1.0 / stiffness, rel=1e-9)


@pytest.mark.parametrize("beyond", [True, False])
def test_plastic_moment_of_a_brick_of_internal_modes(beyond: bool):
    """Points at 0.577 of half the depth carry 2 / sqrt(3) of the moment; before they yield, that of elasticity."""
    metal = mca.J2Bilinear(E=1e9, nu=0.3, rho=1000.0, sigma_y=1e6, E_t=0.0)
    model = model_of(grid((0.5, 0.5, 1.0), (1, 1, 1)), metal, "hex8i")
    yields = 2.0 * metal.sigma_y / (3.0 * metal.shear_modulus)  # curvature at which the surface does, as volumes stay
    curvature = (1.01 if beyond else 0.99) * DEEP * yields
    (sums,) = seen(model, samples_of(model), bent(model, curvature, -0.5), np.zeros((0, 6)))
    assert sums[FLOWING] == pytest.approx(2.0 / np.sqrt(3.0) * sums[FLOW], rel=1e-3)
    assert (sums[FLOW] > 0.0) == beyond
    of_section = 1.0 - 1.0 / (3.0 * DEEP**2)  # moment over the plastic one
    assert 2.0 / 3.0 * DEEP / of_section == pytest.approx(1.0 + bending_flow.limit, abs=0.03)


@pytest.mark.parametrize(("long", "layers"), [(0.25, 1), (1.0, 1), (2.0, 1), (0.5, 2), (1.0, 2), (1.0, 4)])
@pytest.mark.parametrize("element", ["hex8i", "hex8", "hex8r"])
def test_plastic_moment_told_is_that_of_the_forces(element: str, long: float, layers: int):
    """Layers bent to ten times the curvature at which they yield, beside sigma_y b h^2 / 4, by the kernels."""
    mesh = brick(element, (1, 1, layers), (long, 1.0, 1.0))
    body = Statics(Setup(element=element, precision="float64"), mesh, METAL)
    x, y, z = body.body.X.T
    near, far = x < 1e-9, x > long - 1e-9
    held = np.stack([near | far, y < 1e-9, near & (z < 1e-9)], axis=1)
    force = body.drive(held, np.outer(far * 20.0 * SIGMA_Y * long * (z - 0.5), [1.0, 0.0, 0.0]))
    error = force[far, 0] @ (z[far] - 0.5) / (0.25 * SIGMA_Y) - 1.0
    model = body.body.model
    (sums,) = seen(model, samples_of(model), body.body.state.u.numpy(), np.zeros((0, COLUMNS)))
    if element == "hex8r" and layers == 1:
        assert error > 5.0 and sums[MISSED] > 0.9 * sums[SPENT]
    else:
        assert sums[FLOWING] / sums[FLOW] == pytest.approx(1.0 + error, rel=0.03)


YIELDING = {  # cells, element, load over that at which the surface yields, and what must be said
    "early": ((40, 4, 1), "hex8", 0.7, "yield too early in bending, at about 0.7"),
    "late": ((10, 2, 1), "hex8", 2.5, "yield too late in bending"),
    "not at all": ((20, 2, 1), "hex8r", 0.8, "hex8r does not let strip yield"),
    "two layers of one point": ((20, 2, 2), "hex8r", 0.8, "hex8r does not let strip yield"),
    "elastic": ((20, 2, 1), "hex8r", 0.4, ""),
    "one layer that bends right": (
        (20, 2, 1),
        "hex8i",
        1.0,
        "at about 1.15 times the plastic moment; take two or more",
    ),
    "two layers that bend right": ((20, 2, 2), "hex8i", 1.0, ""),
    "points in each half": ((20, 2, 1), "hex8w", 1.0, ""),
    "elastic and right": ((20, 2, 1), "hex8i", 0.4, ""),
}


@pytest.mark.parametrize("case", YIELDING)
def test_plastic_bending(case: str):
    cells, element, load, said = YIELDING[case]
    metal = {"sigma_y": 70e6, "E_t": 0.7e9}
    _, result = sagging(grid((0.04, 0.004, 0.002), cells), 0.3, element, 1e-3 * load, **metal)
    assert any(said in text for text in result.warnings) if said else not [w for w in result.warnings if "yield" in w]
    assert not said or any("two or more cells over the thickness, or hex8w" in text for text in result.warnings)


@pytest.mark.parametrize("options", ["--set rigid=true", ""])
def test_an_element_that_no_body_can_take_is_refused(options: str, tmp_path, capsys):
    scene = tmp_path / "lone.py"
    scene.write_text(
        "import warp_mca as mca\n"
        "from warp_mca.geometry.degenerate import tetrahedral\n"
        "def build(rigid: bool = False) -> mca.Scene:\n"
        "    mesh = mca.Box(size=(1.0, 1.0, 1.0), divisions=(1, 1, 1)).build()\n"
        "    steel = mca.Elastic(E=2e11, nu=0.3, rho=7800.0)\n"
        "    body = mca.Body(name='it', geometry=mesh if rigid else tetrahedral(mesh), material=steel, rigid=rigid)\n"
        "    return mca.Scene(name='lone', bodies=(body,), impact=mca.ImpactPhase(duration=1e-5))\n"
    )
    command = ["run", str(scene), "--element", "hex8r", "--out", str(tmp_path / "out"), *options.split()]
    assert main(command) == 2
    error = capsys.readouterr().err
    assert "element = 'hex8r': it computes hexahedra, of which it has none that deform" in error
    assert len(error.strip().splitlines()) == 1
