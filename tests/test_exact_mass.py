"""`Body.exact_mass`: recipes, CAD and STL files know the volume of their shape, and bodies have its mass."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import watched
from parts import write_parts

import warp_mca as mca
from warp_mca.base.errors import RequestError
from warp_mca.geometry import Box, NestedPlate, Plate, Rod, Sphere
from warp_mca.geometry.cad_volume import enclosed_volume
from warp_mca.geometry.lug import lug, lug_volume
from warp_mca.geometry.quality import volumes
from warp_mca.model.assembly import Assembly
from warp_mca.model.build import build_model
from warp_mca.scene.catalogue import make_scene, scene_names
from warp_mca.scene.model_file import load, save
from warp_mca.watch.mass_report import body_report
from warp_mca.watch.meshes import coarse_mass, coarse_shape

RHO = 2700.0
METAL = mca.Elastic(E=70e9, nu=0.3, rho=RHO)
HEAVY = replace(METAL, rho=3.0 * RHO)
BALL = 4.0 / 3.0 * math.pi


def scene(geometry: Any, material: Any = METAL, **changes: Any) -> mca.Scene:
    options = {name: changes.pop(name) for name in ("gravity", "contacts", "absorbing", "refine") if name in changes}
    duration = changes.pop("duration", 1e-6)
    body = mca.Body(name="b", geometry=geometry, material=material, **changes)
    phase = mca.ImpactPhase(duration=duration, output_interval=duration / 2)
    return mca.Scene(name="s", bodies=(body,), impact=phase, **options)


def weighed(geometry: Any, material: Any = METAL, **changes: Any) -> dict[str, float | None]:
    asked = scene(geometry, material, **changes)
    return body_report(asked.bodies, mca.mesh(asked))["b"]


def small_lug_rod(**changes: Any) -> mca.LugRod:
    return mca.LugRod(**{"radius": 0.01, "length": 0.1, "section": 4, "ring": 2, "axial": 4, **changes})


SHAPES = [
    (Sphere(radius=0.01), BALL * 1e-6),
    (Sphere(radius=0.02, section=2, ring=1, pole_layers=2), BALL * 8e-6),
    (Sphere(radius=0.01, part="half", section=4, ring=2), BALL * 0.5e-6),
    (Sphere(radius=0.01, part="quarter", section=4, ring=2), BALL * 0.25e-6),
    (Rod(radius=0.005, length=0.05, tip="flat", section=4, ring=2), math.pi * 0.005**2 * 0.05),
    (Rod(radius=0.01, length=0.05, axial=4, focus_angle=0.5), math.pi * 1e-4 * 0.04 + BALL * 0.5e-6),
    (Plate(length=0.1, width=0.06, height=0.03), 0.1 * 0.06 * 0.03),
    (Plate(length=0.1, width=0.06, height=0.03, part="quarter"), 0.1 * 0.06 * 0.03 / 4),
    (NestedPlate(length=0.1, width=0.06, height=0.03), 0.1 * 0.06 * 0.03),
    (Box(size=(0.1, 0.2, 0.3), divisions=(1, 2, 3)), 0.1 * 0.2 * 0.3),
]


@pytest.mark.parametrize(("recipe", "volume"), SHAPES)
@pytest.mark.parametrize("element", ["hex8", "tet4", "tet10"])
def test_recipes_have_the_mass_of_their_shape(recipe: Any, volume: float, element: str):
    assert recipe.volume == pytest.approx(volume, rel=1e-12)
    own = weighed(recipe, element=element)
    assert own["mass"] == pytest.approx(RHO * volume, rel=1e-9)
    flat = isinstance(recipe, (Box, Plate, NestedPlate))
    cells = float(volumes(recipe.build()).sum())
    assert own["mass_error"] == (0.0 if flat else pytest.approx(cells / volume - 1.0, rel=0.05))
    plain = weighed(recipe, exact_mass=False)
    assert plain["mass"] == pytest.approx(RHO * cells, rel=1e-12)
    assert plain["mass_error"] == pytest.approx(cells / volume - 1.0, abs=1e-12)


@pytest.mark.parametrize("kind", ["eye", "fork"])
def test_lugs_have_the_limit_of_finer_meshes(kind: Any):
    """Chords leave out a share of h^2: (4 V(h / 2) - V(h)) / 3 is the limit up to h^4."""
    coarse, fine = (float(volumes(lug(kind, section, section // 2)).sum()) for section in (16, 32))
    assert lug_volume(kind) == pytest.approx((4.0 * fine - coarse) / 3.0, rel=3e-4)
    assert lug_volume(kind) > fine


@pytest.mark.parametrize("ends", [("eye", "eye"), ("fork", "flat"), ("flat", "fork")])
def test_rods_with_lugs_have_both(ends: tuple[Any, Any]):
    recipe = small_lug_rod(tip="flat", start=ends[0], end=ends[1], section=12, ring=4)
    assert weighed(recipe)["mass"] == pytest.approx(RHO * recipe.volume, rel=1e-12)
    assert weighed(recipe)["mass_error"] == pytest.approx(-0.004, abs=0.001)


def test_each_cell_set_has_its_own_mass():
    recipe = small_lug_rod()
    mesh = recipe.build()
    own = volumes(mesh) * mesh.volume_ratio
    assert own[mesh.cell_sets["tip"]].sum() == pytest.approx(2.0 / 3.0 * math.pi * 1e-6, rel=1e-12)
    mass = weighed(recipe, {"tip": HEAVY, "body": METAL})["mass"]
    assert mass == pytest.approx(RHO * (recipe.volume + 2.0 * 2.0 / 3.0 * math.pi * 1e-6), rel=1e-12)


def test_parts_and_finished_meshes_keep_what_they_know():
    ball, bare = Sphere(radius=0.01, section=2, ring=1, pole_layers=2), Box(size=(1.0, 1.0, 1.0), divisions=(1, 1, 1))
    box = bare.build()
    plain = mca.Mesh(box.points, box.hexahedra)
    parts = mca.Parts(
        parts=(
            mca.Part(name="a", geometry=ball),
            mca.Part(name="b", geometry=plain, at=(1.0, 0.0, 0.0)),
            mca.Part(name="c", geometry=replace(ball, radius=0.02), at=(3.0, 0.0, 0.0)),
        )
    )
    exact = RHO * (BALL * 9e-6 + 1.0)
    assert weighed(parts, element="tet4")["mass"] == pytest.approx(exact, rel=1e-12)
    moved = replace(ball.build(), points=2.0 * ball.build().points)  # a mesh of one's own, twice as large
    assert weighed(moved)["mass"] == pytest.approx(RHO * BALL * 8e-6, rel=1e-12)
    assert weighed(plain) == {"mass": pytest.approx(RHO), "mass_error": None}
    assert weighed(ball, refine=2.0)["mass"] == pytest.approx(RHO * BALL * 1e-6, rel=1e-12)


@dataclass(frozen=True)
class Wedge:
    """A recipe of a user's own: a quarter of a cylinder as one brick with a corner moved."""

    volume: Any = 0.25 * math.pi

    def build(self) -> mca.Mesh:
        box = Box(size=(1.0, 1.0, 1.0), divisions=(1, 1, 1)).build()
        far = (box.points[:, 0] == 1.0) & (box.points[:, 1] == 1.0)
        points = np.where(far[:, None], box.points * [math.sqrt(0.5), math.sqrt(0.5), 1.0], box.points)
        return mca.Mesh(points, box.hexahedra)


def test_recipes_of_a_users_own_may_have_a_volume():
    own = weighed(Wedge())
    assert own["mass"] == pytest.approx(RHO * 0.25 * math.pi)
    assert own["mass_error"] == pytest.approx(math.sqrt(0.5) / (0.25 * math.pi) - 1.0)
    assert weighed(Wedge(None)) == {"mass": pytest.approx(RHO * math.sqrt(0.5)), "mass_error": None}
    in_parts = mca.Parts(parts=(mca.Part(name="w", geometry=Wedge()),))
    assert weighed(in_parts)["mass"] == pytest.approx(RHO * 0.25 * math.pi)
    for wrong in (-1.0, math.nan, "1", 0.25e9):  # the last one is in cubic millimetres
        with pytest.raises(RequestError, match="volume"):
            weighed(Wedge(wrong))


@pytest.mark.parametrize("ratio", [np.zeros(8), np.ones(3), np.array([math.nan]), "1"])
def test_a_wrong_volume_ratio_of_a_mesh_is_refused(ratio: Any):
    box = Box(size=(1.0, 1.0, 1.0), divisions=(2, 2, 2)).build()
    with pytest.raises(RequestError, match="volume_ratio"):
        weighed(replace(box, volume_ratio=ratio))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cylinder beside a ball and a ring in millimetres, two of them with names, and the parts of `write_parts`."""
    import gmsh

    made = tmp_path_factory.mktemp("cad")
    write_parts(made)
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        shapes = gmsh.model.occ
        solids = [
            shapes.addCylinder(0, 0, 0, 0, 0, 20, 5),
            shapes.addSphere(0, 0, 40, 8),
            shapes.addTorus(40, 0, 0, 9, 3),
        ]
        shapes.synchronize()
        gmsh.model.setEntityName(3, solids[0], "shaft")
        gmsh.model.setEntityName(3, solids[1], "ball")
        for suffix in ("step", "brep"):
            gmsh.write(str(made / f"three.{suffix}"))
    finally:
        gmsh.finalize()
    return made


@pytest.mark.parametrize(("name", "scale"), [("three.step", None), ("three.step", 2e-3), ("three.brep", 1e-3)])
def test_solids_of_a_cad_file_have_their_exact_mass(folder: Path, name: str, scale: float | None):
    recipe = mca.Cad(folder / name, size=6.0 * (scale or 1e-3), scale=scale)
    mm = (scale or 1e-3) ** 3
    exact = [mm * 500.0 * math.pi, mm * BALL * 512.0, mm * 2.0 * math.pi**2 * 9.0 * 9.0]
    assert recipe.volume == pytest.approx(sum(exact), rel=1e-6)
    mesh = recipe.build()
    own = volumes(mesh) * mesh.volume_ratio
    for cells, volume in zip(mesh.cell_sets.values(), exact, strict=True):
        assert own[cells].sum() == pytest.approx(volume, rel=1e-6)
    first = next(iter(mesh.cell_sets))
    mass = weighed(recipe, {first: HEAVY, "*": METAL})
    assert mass["mass"] == pytest.approx(RHO * (3.0 * exact[0] + exact[1] + exact[2]), rel=1e-6)
    assert mass["mass_error"] is not None and -0.25 < mass["mass_error"] < -0.05
    assert weighed(recipe, refine=1.5)["mass"] == pytest.approx(RHO * sum(exact), rel=1e-6)


@pytest.mark.parametrize("suffix", ["step", "iges", "brep", "stl"])
def test_flat_parts_of_cad_files_are_exact_as_they_are(folder: Path, suffix: str):
    own = weighed(mca.Cad(folder / f"part.{suffix}", size=12e-3, scale=1e-3))
    assert own["mass"] == pytest.approx(RHO * 24e-6, rel=1e-9)
    assert own["mass_error"] == pytest.approx(0.0, abs=1e-9)


def test_an_stl_ball_has_the_mass_within_its_triangles(folder: Path):
    import meshio

    stl = meshio.read(folder / "ball.stl")
    a, b, c = np.moveaxis(stl.points[stl.cells_dict["triangle"]], 1, 0)
    within = abs(float(np.einsum("ei,ei->", a, np.cross(b, c)))) / 6.0 * 1e-9
    assert 0.9 < within / (BALL * 1e-6) < 1.0
    own = weighed(mca.Cad(folder / "ball.stl", size=6e-3, scale=1e-3))
    assert own["mass"] == pytest.approx(RHO * within, rel=1e-5)
    assert own["mass_error"] is not None and own["mass_error"] < -0.01


def test_the_volume_within_triangles():
    """Two boxes, one as a void in the other, whichever way either is turned; triangles that face about have none."""
    outer = Box(size=(3.0, 2.0, 2.0), divisions=(2, 2, 2)).build()
    inner = Box(size=(1.0, 0.5, 0.5), divisions=(1, 1, 1), origin=(1.0, 1.0, 1.0)).build()

    def skin(mesh: mca.Mesh, first: int, inward: bool) -> np.ndarray:
        quads = mesh.boundary[0] + first
        found = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
        return found[:, ::-1] if inward else found

    points = np.concatenate([outer.points, inner.points]) + 5.0
    for inward in (False, True):
        hollow = np.concatenate([skin(outer, 0, False), skin(inner, len(outer.points), inward)])
        assert enclosed_volume(points, hollow) == pytest.approx(12.0 - 0.25)
    assert enclosed_volume(points, np.concatenate([hollow[:1, ::-1], hollow[1:]])) is None


def test_momentum_energy_and_step_are_those_of_the_exact_mass():
    """Kinetic energy m v^2 / 2, work of gravity m g v t, and a step longer by the root of the share of mass."""
    recipe, g, t = Sphere(radius=0.01, section=2, ring=1, pole_layers=2), 9.81, 1e-4
    asked = scene(recipe, velocity=(2.0, 0.0, -1.0), gravity=(0.0, 0.0, -g), duration=t)
    exact = mca.run(asked, device="cpu", precision="float64").summary
    plain = mca.run(scene(recipe, exact_mass=False), device="cpu", precision="float64").summary
    mass = RHO * BALL * 1e-6
    assert exact["bodies"]["b"]["mass"] == pytest.approx(mass, rel=1e-12)
    assert exact["energy"]["initial"] == pytest.approx(2.5 * mass, rel=1e-12)
    assert exact["energy"]["external_work"] == pytest.approx(mass * g * t * (1.0 + 0.5 * g * t), rel=1e-3)
    share = mass / plain["bodies"]["b"]["mass"]
    assert share > 1.2
    assert exact["stable_dt"] / plain["stable_dt"] == pytest.approx(math.sqrt(share), rel=1e-9)


@pytest.mark.parametrize(
    ("recipe", "section", "rigid"),
    [
        (Sphere(radius=0.01, section=4, ring=2, pole_layers=2), "pole", False),
        (Sphere(radius=0.003, section=2, ring=1, pole_layers=2), "pole", False),
        (small_lug_rod(focus_layers=2), "contact", True),
        (Rod(radius=0.01, length=0.03, section=4, ring=2, axial=2, focus_layers=2), "contact", True),
    ],
)
def test_the_impulse_of_a_bounce_is_twice_the_exact_momentum(recipe: Any, section: str, rigid: bool):
    """On the axis of the body; an elastic ball keeps 1 % of its speed as vibration at most."""
    soft, v = mca.Elastic(E=1e9, nu=0.3, rho=RHO), 0.5
    end = float(recipe.build().points[:, 0].max())
    plane = mca.RigidPlane(point=(end + 1e-6, 0.0, 0.0), normal=(-1.0, 0.0, 0.0))
    contact = mca.Contact(slave=mca.Surface(body="b", nodes=section), master=plane, mu=0.0)
    options: Any = {"contacts": (contact,), "duration": 0.15 * recipe.radius / v}
    result = mca.run(scene(recipe, soft, velocity=(v, 0.0, 0.0), rigid=rigid, **options), device="cpu")
    impulse = -result.summary["contacts_by_pair"][0]["impulse"][0]
    assert not result.summary["contact_open_at_end"]
    assert impulse == pytest.approx(2.0 * RHO * recipe.volume * v, rel=1e-3 if rigid else 0.01)


def test_rigid_bodies_and_swings_have_it_too():
    recipe = Sphere(radius=0.01, section=2, ring=1, pole_layers=2)
    asked = scene(recipe, rigid=True, velocity=(1.0, 0.0, 0.0), angular_velocity=(0.0, 0.0, 10.0))
    exact, plain = (
        mca.run(replace(asked, bodies=(replace(asked.bodies[0], exact_mass=on),)), device="cpu").summary
        for on in (True, False)
    )
    one, other = (run["rigid_bodies"]["b"] for run in (exact, plain))
    share = exact["bodies"]["b"]["mass"] / plain["bodies"]["b"]["mass"]
    assert one["mass"] == pytest.approx(RHO * BALL * 1e-6, rel=1e-12)
    assert one["spin"][2] / other["spin"][2] == pytest.approx(share, rel=1e-12)


def test_absorbing_sides_match_the_waves_of_the_exact_mass():
    """Impedance rho c goes as the root of the density."""
    recipe = Rod(radius=0.005, length=0.05, tip="flat", section=2, ring=1, axial=4)
    found = []
    for on in (True, False):
        asked = scene(recipe, exact_mass=on, absorbing=(mca.Absorbing(body="b", nodes="end"),))
        meshes = mca.mesh(asked)
        X = {"b": meshes["b"].points}
        model = build_model(asked, meshes, X, {"b": 0.0 * X["b"]})
        found.append((model.absorbing.damping, model.mass.sum()))
    (exact, heavy), (plain, light) = found
    assert heavy / light > 1.05
    assert exact == pytest.approx(math.sqrt(heavy / light) * plain, rel=1e-9)


def test_scenes_of_a_batch_have_their_own():
    recipe = Sphere(radius=0.01, section=2, ring=1, pole_layers=2)
    asked = [scene(recipe, velocity=(1.0, 0.0, 0.0), exact_mass=on) for on in (True, False)]
    alone = [mca.run(item, device="cpu").summary["energy"]["initial"] for item in asked]
    assert [item.summary["energy"]["initial"] for item in mca.run_batch(asked, device="cpu")] == pytest.approx(alone)


def test_model_files_keep_it_and_older_ones_keep_their_mass(tmp_path: Path):
    recipe = Sphere(radius=0.01, section=2, ring=1, pole_layers=2)
    asked = scene(recipe)
    meshes, file = mca.mesh(asked), tmp_path / "b.mca"
    save(file, asked, meshes)
    stored = load(file)
    assert body_report(stored.scene.bodies, stored.meshes) == body_report(asked.bodies, meshes)

    def forget(item: Any) -> Any:
        if isinstance(item, dict):
            return {key: forget(value) for key, value in item.items() if key not in ("exact_mass", "volume_ratio")}
        return [forget(value) for value in item] if isinstance(item, list) else item

    with np.load(file) as archive:
        entries = dict(archive)
    header = forget(json.loads(entries["header"].tobytes()))
    np.savez(tmp_path / "old.npz", **entries | {"header": np.frombuffer(json.dumps(header).encode(), np.uint8)})
    (tmp_path / "old.npz").rename(tmp_path / "old.mca")
    stored = load(tmp_path / "old.mca")
    cells = RHO * float(volumes(meshes["b"]).sum())
    assert body_report(stored.scene.bodies, stored.meshes)["b"] == {"mass": pytest.approx(cells), "mass_error": None}


def test_a_word_is_said_from_two_percent_on():
    def told(recipe: Any, **changes: Any) -> list[str]:
        asked = scene(recipe, **changes)
        row = coarse_shape if asked.bodies[0].exact_mass else coarse_mass
        return watched.told(row, scene=asked, meshes=mca.mesh(asked))

    (text,) = told(Sphere(radius=0.01))
    assert "2.9% less mass" in text and "scaled" in text and "refine" in text
    (text,) = told(Sphere(radius=0.01), exact_mass=False)
    assert "2.9% less mass" in text and "the body has that mass" in text
    assert told(Sphere(radius=0.01), refine=2.0) == []
    assert told(Box(size=(1.0, 1.0, 1.0), divisions=(1, 1, 1))) == []
    for on in (True, False):
        result = mca.run(scene(Sphere(radius=0.01, section=2, ring=1, pole_layers=2), exact_mass=on), device="cpu")
        assert sum("less mass" in text for text in result.warnings) == 1


@pytest.mark.parametrize("name", scene_names())
def test_round_bodies_of_built_in_scenes_have_the_mass_of_their_cells(name: str):
    """Their published figures, and the accuracies that were measured, are of that mass."""
    for body in make_scene(name).bodies:
        assert isinstance(body.geometry, (Box, Plate, NestedPlate, mca.Mesh, mca.Parts)) or not body.exact_mass, (
            body.name
        )


def test_the_assembly_is_that_of_the_shape():
    recipe = small_lug_rod()
    asked = scene(recipe)
    meshes = mca.mesh(asked)
    parts = Assembly(asked, meshes, {"b": meshes["b"].points})
    assert parts.mass.sum() == pytest.approx(RHO * recipe.volume, rel=1e-12)
    assert parts.volume.sum() == pytest.approx(
        volumes(meshes["b"]).sum(), rel=1e-12
    )  # springs and steps know the cells


def test_exact_mass_is_true_or_false():
    with pytest.raises(RequestError, match="exact_mass"):
        mca.Body(name="b", geometry=Sphere(radius=0.01), material=METAL, exact_mass=1)  # type: ignore[arg-type]
