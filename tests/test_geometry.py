"""Tests the geometry recipes against closed forms, and their refusals."""

from __future__ import annotations

import dataclasses
import math
from typing import Literal

import numpy as np
import pytest
from recipes import FOCUS, LENGTH, R, area, plate, rod

from warp_mca.base.errors import RequestError
from warp_mca.geometry import Box, Mesh, MeshFile, Sphere
from warp_mca.geometry.blocks import Blocks, growth
from warp_mca.geometry.degenerate import tetrahedral
from warp_mca.geometry.edit import compact
from warp_mca.geometry.quality import check, edge_lengths, scaled_jacobian, volumes
from warp_mca.verify.small_meshes import patch


def has_node(mesh: Mesh, place: tuple[float, float, float], tolerance: float = 0.0) -> bool:
    return bool((np.abs(mesh.points - place).max(axis=1) <= tolerance).any())


def assert_symmetric(mesh: Mesh, axis: int) -> None:
    image = mesh.points.copy()
    image[:, axis] = 0.0 - image[:, axis]
    assert {tuple(p) for p in mesh.points} == {tuple(p) for p in image}


def assert_sound(mesh: Mesh) -> None:
    """No orphan, no doubled node, no crack inside, no inverted element; cell sets that share out the elements."""
    assert np.array_equal(np.unique(mesh.hexahedra), np.arange(len(mesh.points)))
    assert len(np.unique(np.round(mesh.points / 1e-9), axis=0)) == len(mesh.points)
    faces, _ = mesh.boundary
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()  # the skin is closed
    check(mesh, "it")
    owned = np.concatenate(list(mesh.cell_sets.values()))
    assert np.array_equal(np.sort(owned), np.arange(len(mesh.hexahedra)))
    assert mesh.points.dtype == np.float64
    assert {a.dtype for a in (mesh.hexahedra, *mesh.node_sets.values(), *mesh.cell_sets.values())} == {np.dtype("i4")}


def test_box():
    mesh = Box(size=(1.0, 2.0, 3.0), divisions=(2, 3, 4), origin=(-0.5, 0.0, 1.0)).build()
    assert_sound(mesh)
    assert volumes(mesh) == pytest.approx(6.0 / 24)
    assert scaled_jacobian(mesh) == pytest.approx(1.0)
    assert [area(mesh, name) for name in ("xmin", "ymax", "zmin")] == pytest.approx([6.0, 3.0, 2.0])
    assert mesh.points.min(axis=0).tolist() == [-0.5, 0.0, 1.0]


def test_rod_volume_converges_at_second_order():
    exact = math.pi * R**2 * (LENGTH - R) + 2.0 / 3.0 * math.pi * R**3
    errors = [
        1.0 - volumes(rod(section=n, ring=n // 2, tip_layers=n, focus_layers=n).build()).sum() / exact
        for n in (4, 8, 16)
    ]
    assert errors[0] < 0.05
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.15)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.1)


def test_rod_sets_cover_their_surfaces():
    mesh = rod(section=16, ring=4, axial=4, tip_layers=16, focus_layers=16).build()
    assert area(mesh, "start") == pytest.approx(math.pi * R**2, rel=2e-3)
    assert area(mesh, "side") == pytest.approx(2.0 * math.pi * R * (LENGTH - R), rel=2e-3)
    assert area(mesh, "tip") == pytest.approx(2.0 * math.pi * R**2, rel=4e-3)
    whole = area(mesh, "start") + area(mesh, "side") + area(mesh, "tip")
    assert area(mesh, "boundary") == pytest.approx(whole, rel=1e-12)
    centroids = mesh.points[mesh.hexahedra].mean(axis=1)
    assert (centroids[mesh.cell_sets["tip"], 0] > LENGTH - R).all()
    assert (centroids[mesh.cell_sets["body"], 0] < LENGTH - R).all()

    flat = rod(tip="flat", section=16).build()
    assert area(flat, "end") == pytest.approx(math.pi * R**2, rel=2e-3)
    assert set(flat.node_sets) == {"start", "side", "end"}
    assert (flat.points[flat.nodes("end"), 0] == LENGTH).all()


def test_rod_exact_nodes():
    mesh = rod().build()
    centre = np.array([LENGTH - R, 0.0, 0.0])
    focus = centre + R * np.array([math.cos(FOCUS), math.sin(FOCUS), 0.0])
    assert has_node(mesh, tuple(centre))
    assert has_node(mesh, tuple(focus), 1e-17)
    arms = np.linalg.norm(mesh.points[mesh.nodes("tip")] - centre, axis=1)
    assert arms == pytest.approx(R, rel=4e-15)
    assert (mesh.points[mesh.nodes("start"), 0] == 0.0).all()
    reach = np.linalg.norm(mesh.points[mesh.nodes("contact")] - focus, axis=1).max()
    assert 0.4 * R < reach < 1.2 * R
    assert has_node(rod(focus_angle=0.0).build(), (LENGTH, 0.0, 0.0))


def test_fine_patch_has_the_asked_size():
    mesh = rod(focus_size=0.5e-3).build()
    focus = (LENGTH - R + R * math.cos(FOCUS), R * math.sin(FOCUS), 0.0)
    node = np.linalg.norm(mesh.points - focus, axis=1).argmin()
    around = edge_lengths(mesh).reshape(-1, 12)[(mesh.hexahedra == node).any(axis=1)]
    assert around.min() == pytest.approx(0.5e-3, rel=0.05)
    assert edge_lengths(mesh).min() > 0.8 * 0.5e-3


def test_hinge_nodes_of_two_rods_coincide():
    lines = []
    for mesh in (rod(tip="flat", axial=7).build(), rod(axial=5, axial_ratio=2.0, focus_angle=-0.3).build()):
        on_axis = (mesh.points[:, 0] == 0.0) & (mesh.points[:, 1] == 0.0)
        lines.append(np.sort(mesh.points[on_axis, 2]))
    end = rod(tip="flat").build().points
    lines.append(np.sort(end[(end[:, 0] == LENGTH) & (end[:, 1] == 0.0), 2]))
    assert len(lines[0]) == 3 + 6 + 3 + 1  # ring, core, ring
    assert lines[0][[0, 6, 12]] == pytest.approx([-R, 0.0, R], abs=1e-17)
    assert np.array_equal(lines[0], lines[1])
    assert lines[0] == pytest.approx(lines[2], abs=1e-12)


@pytest.mark.parametrize("degrees", [-60.0, -36.43, 0.0, 20.0, 50.0, 60.0])
@pytest.mark.parametrize("section", [6, 12])
def test_rod_is_sound_at_any_focus(degrees: float, section: int):
    mesh = rod(focus_angle=math.radians(degrees), section=section).build()
    assert_sound(mesh)
    assert_symmetric(mesh, 2)
    assert scaled_jacobian(mesh).min() > (0.5 if abs(degrees) < 40.0 else 0.29)


@pytest.mark.parametrize(
    "changes",
    [{"section": 2, "ring": 1}, {"section": 4, "ring": 4}, {"length": 0.03}, {"radius": 0.1}, {"tip": "flat"}],
    ids=str,
)
def test_rod_is_sound_in_other_proportions(changes: dict):
    mesh = rod(**changes).build()
    assert_sound(mesh)
    assert scaled_jacobian(mesh).min() > 0.4


def test_axial_ratio():
    mesh = rod(tip="flat", axial=9, axial_ratio=3.0).build()
    stations = np.unique(np.round(mesh.points[:, 0], 8))
    cells = np.diff(stations)
    assert len(cells) == 9
    assert cells[0] / cells[-1] == pytest.approx(3.0, rel=1e-4)
    assert cells[1:] / cells[:-1] == pytest.approx(3.0 ** (-1 / 8), rel=1e-4)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"core": (6, 4)},
        {"length": 0.3, "width": 0.2, "height": 0.03},
        {"box": 0.03},
        {"length": 0.1},
        {"layers": 2},
    ],
    ids=str,
)
def test_plate(changes: dict):
    mesh = plate(**changes).build()
    assert_sound(mesh)
    assert_symmetric(mesh, 0)
    assert_symmetric(mesh, 2)
    assert has_node(mesh, (0.0, 0.0, 0.0))
    assert scaled_jacobian(mesh).min() > (0.45 if "box" in changes else 0.57)
    assert edge_lengths(mesh).min() == pytest.approx(0.6e-3, rel=1e-6)
    size = {"length": 1.2, "width": 0.1, "height": 0.05} | changes
    length, width, height = (size[name] for name in ("length", "width", "height"))
    assert volumes(mesh).sum() == pytest.approx(length * width * height, rel=1e-9)
    faces = {"top": length * width, "bottom": length * width, "xmin": width * height, "zmax": length * height}
    for name, expected in faces.items():
        assert area(mesh, name) == pytest.approx(expected, rel=1e-9)
    contact = mesh.points[mesh.nodes("contact")]
    assert (contact[:, 1] == 0.0).all()
    assert np.abs(contact).max() <= 4.0 * 1.8e-3 * (1.0 + 1e-8)
    assert area(mesh, "contact") > (2.0 * 1.8e-3) * (2.0 * 1.2e-3) * (1.0 - 1e-9)


def test_quarter_of_a_plate():
    mesh = plate(part="quarter").build()
    assert_sound(mesh)
    assert volumes(mesh).sum() == pytest.approx(1.2 * 0.1 * 0.05 / 4.0, rel=1e-9)
    assert area(mesh, "xmin") == pytest.approx(0.05 * 0.05, rel=1e-9)
    assert (mesh.points[mesh.nodes("xmin"), 0] == 0.0).all()


def test_sphere_volume_converges_at_second_order():
    exact = 4.0 / 3.0 * math.pi * R**3
    errors = [
        1.0 - volumes(Sphere(radius=R, section=n, ring=n // 2, pole_layers=n).build()).sum() / exact for n in (4, 8, 16)
    ]
    assert errors[0] < 0.08
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.1)


@pytest.mark.parametrize(("part", "share", "cuts"), [("whole", 1.0, ""), ("half", 0.5, "z"), ("quarter", 0.25, "yz")])
@pytest.mark.parametrize("changes", [{}, {"section": 4, "pole_size": R / 200.0, "pole_layers": 10}], ids=str)
def test_sphere(part: Literal["whole", "half", "quarter"], share: float, cuts: str, changes: dict):
    mesh = Sphere(radius=R, part=part, **changes).build()
    assert_sound(mesh)
    assert scaled_jacobian(mesh).min() > 0.5
    assert has_node(mesh, (R, 0.0, 0.0))
    assert has_node(mesh, (0.0, 0.0, 0.0))
    assert np.linalg.norm(mesh.points[mesh.nodes("surface")], axis=1) == pytest.approx(R, rel=4e-15)
    assert area(mesh, "surface") == pytest.approx(share * 4.0 * math.pi * R**2, rel=0.05)
    for axis in cuts:
        assert area(mesh, f"{axis}min") == pytest.approx(math.pi * R**2 / len(cuts), rel=0.05)
    assert set(mesh.node_sets) == {"surface", "pole", *(f"{axis}min" for axis in cuts)}
    pole = mesh.points[mesh.nodes("pole")]
    reach = np.linalg.norm(pole - [R, 0.0, 0.0], axis=1).max()
    assert 0.5 * R < reach < 1.2 * R
    if "pole_size" in changes:
        assert edge_lengths(mesh).min() > 0.8 * R / 200.0


@pytest.mark.parametrize(("field", "value"), [("radius", 0.0), ("section", 3), ("part", "third"), ("pole_size", R)])
def test_sphere_refusals(field: str, value: object):
    with pytest.raises(RequestError, match=f"Sphere.{field}"):
        Sphere(**{"radius": R, field: value})


@pytest.mark.parametrize(
    "recipe",
    [rod(), plate(), Sphere(radius=R, part="quarter"), Box(size=(1.0, 1.0, 1.0), divisions=(2, 2, 2))],
    ids=repr,
)
def test_same_recipe_same_bits(recipe):
    first, second = recipe.build(), recipe.build()
    assert first.points.tobytes() == second.points.tobytes()
    assert first.hexahedra.tobytes() == second.hexahedra.tobytes()
    for name, nodes in first.node_sets.items():
        assert np.array_equal(nodes, second.node_sets[name])


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: rod(radius=-1.0), "Rod.radius"),
        (lambda: rod(length=math.nan), "Rod.length"),
        (lambda: rod(length=R), "Rod.length"),
        (lambda: rod(section=5), "Rod.section"),
        (lambda: rod(ring=0), "Rod.ring"),
        (lambda: rod(axial=2.5), "Rod.axial"),
        (lambda: rod(axial_ratio=0.0), "Rod.axial_ratio"),
        (lambda: rod(tip="cone"), "Rod.tip"),
        (lambda: rod(tip_layers=0), "Rod.tip_layers"),
        (lambda: rod(focus_angle=1.2), "Rod.focus_angle"),
        (lambda: rod(focus_size=5e-3), "Rod.focus_size"),
        (lambda: rod(focus_layers=0), "Rod.focus_layers"),
        (lambda: plate(height=0.0), "Plate.height"),
        (lambda: plate(core=(6, 5)), "Plate.core"),
        (lambda: plate(core=(6,)), "Plate.core"),
        (lambda: plate(core_size=0.02), "Plate.core_size"),
        (lambda: plate(layers=0), "Plate.layers"),
        (lambda: plate(box=0.06), "Plate.box"),
        (lambda: plate(contact=-1.0), "Plate.contact"),
        (lambda: plate(extension=0), "Plate.extension"),
        (lambda: Box(size=(1.0, 0.0, 1.0), divisions=(1, 1, 1)), "Box.size"),
        (lambda: Box(size=(1.0, 1.0, 1.0), divisions=(1, 1, True)), "Box.divisions"),
        (lambda: Box(size=(1.0, 1.0, 1.0), divisions=(1, 1, 1), origin=(0.0, 0.0)), "Box.origin"),
        (lambda: MeshFile(path=3), "MeshFile.path"),
    ],
)
def test_bad_values_are_named(make, field: str):
    with pytest.raises(RequestError, match=field.replace(".", r"\.") + " = "):
        make()


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Box(size=(1.0, 1.0, 1.0), divisions=(100_000, 100_000, 1)), r"Box\.divisions = \(100000, 100000, 1\)"),
        (lambda: rod(axial=10**9).build(), r"Rod\.axial = 1000000000"),
        (lambda: plate(layers=10**9).build(), r"Plate\.layers = 1000000000"),
        (lambda: Sphere(radius=R, section=10**6).build(), r"Sphere\.section = 1000000"),
    ],
)
def test_more_elements_than_fit_any_machine_are_refused_before_memory_is_taken(make, words: str):
    with pytest.raises(RequestError, match=f"^{words}: more than 200,000,000 elements"):
        make()


def test_many_cells_beyond_the_box():
    """Powers of the factor by which they grow went beyond what a float holds."""
    assert growth(400.0, 300, 1.0) == pytest.approx(1.0018, rel=1e-3)
    mesh = plate(length=0.06, width=0.04, height=0.01, extension=400, part="quarter").build()
    assert_sound(mesh)
    assert len(np.unique(mesh.points[mesh.nodes("zmax")][:, 0].round(9))) > 400


def test_growth():
    q = growth(10.0, 5, 0.7)
    assert sum(0.7 * q**i for i in range(1, 6)) == pytest.approx(10.0)
    assert growth(1.0, 5, 0.7) == pytest.approx(1.0)


def test_blocks_must_agree_on_shared_edges():
    blocks = Blocks("it", count=4)
    low = [blocks.point(p) for p in ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0))]
    middle, high = ([blocks.point((*blocks.position(p)[:2], z)) for p in low] for z in (1.0, 2.0))
    blocks.block(low + middle, (2, 3, 4), "a")
    with pytest.raises(RequestError, match="divide it differently"):
        blocks.block(middle + high, (2, 4, 4), "b")


def test_check_names_body_and_element():
    mesh = Box(size=(1.0, 1.0, 1.0), divisions=(2, 1, 1)).build()
    bad = Mesh(mesh.points, np.array([mesh.hexahedra[0], np.roll(mesh.hexahedra[1], 4)]))
    with pytest.raises(RequestError, match="body arm: 1 of 2 elements are inverted, first element 1"):
        check(bad, "arm")


def test_hexahedra_are_judged_at_their_gauss_points():
    """The standard patch has a corner that is folded over a little; the hexahedron integrates no such point."""
    mesh = patch()
    assert scaled_jacobian(mesh).min() < 0.0 < mesh.least_jacobians.min()
    check(mesh, "arm")


def test_tetrahedra_are_judged_by_their_volume():
    mesh = tetrahedral(Box(size=(1.0, 1.0, 1.0), divisions=(1, 1, 1)).build())
    turned = mesh.tetrahedra.copy()
    turned[2] = turned[2][[0, 2, 1, 3]]
    with pytest.raises(RequestError, match="body arm: 1 of 6 elements are inverted, first element 2"):
        check(dataclasses.replace(mesh, tetrahedra=turned), "arm")


def test_compact_drops_unused_nodes():
    box = Box(size=(1.0, 1.0, 1.0), divisions=(1, 1, 1)).build()
    points = np.concatenate([[[9.0, 9.0, 9.0]], box.points])
    loose = Mesh(points, box.hexahedra + np.int32(1), {"some": np.array([0, 3], dtype=np.int32)}, box.cell_sets)
    mesh = compact(loose)
    assert np.array_equal(mesh.points, box.points)
    assert np.array_equal(mesh.hexahedra, box.hexahedra)
    assert mesh.node_sets["some"].tolist() == [2]
