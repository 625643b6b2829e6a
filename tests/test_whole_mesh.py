"""Tests what is refused of meshes that are made by hand, or given to a run beside its scene, and of their sets."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.base.errors import RequestError
from warp_mca.geometry import Box, Mesh
from warp_mca.geometry.degenerate import tetrahedral
from warp_mca.geometry.quality import check
from warp_mca.model.build import build_model
from warp_mca.physics.elements.cells import body_materials
from warp_mca.system.model import Model


def broken(fault: str) -> Mesh:
    """Two cells in a row with one fault."""
    whole = Box(size=(2.0, 1.0, 1.0), divisions=(2, 1, 1)).build()
    points, cells = whole.points, whole.hexahedra
    last = int(cells.max())
    return {
        "none": whole,
        "coordinate": dataclasses.replace(whole, points=np.where(np.arange(12)[:, None] == 3, np.nan, points)),
        "two-dimensional": dataclasses.replace(whole, points=points[:, :2]),
        "seven corners": dataclasses.replace(whole, hexahedra=cells[:, :7]),
        "floats as nodes": dataclasses.replace(whole, hexahedra=cells.astype(np.float64)),
        "node beyond": dataclasses.replace(whole, hexahedra=np.where(cells == last, 99, cells)),
        "node below": dataclasses.replace(whole, hexahedra=np.where(cells == last, -1, cells)),
        "cell twice": dataclasses.replace(whole, hexahedra=np.vstack([cells, np.roll(cells[:1], 4, axis=1)])),
        "idle node": dataclasses.replace(whole, points=np.vstack([points, [[9.0, 9.0, 9.0]]])),
        "no cell": dataclasses.replace(whole, points=points[:0], hexahedra=cells[:0], node_sets={}),
        "set beyond": dataclasses.replace(whole, node_sets={"end": np.array([0, 12])}),
        "cell set beyond": dataclasses.replace(whole, cell_sets={"core": np.array([2])}),
        "mask": dataclasses.replace(whole, node_sets={"end": points[:, 0] > 1.5}),
        "node twice": dataclasses.replace(whole, node_sets={"end": np.array([3, 7, 3])}),
        "flat list": dataclasses.replace(whole, node_sets={"end": [0, 1]}),
        "table": dataclasses.replace(whole, node_sets={"end": np.array([[0, 1]])}),
        "sets": dataclasses.replace(whole, node_sets=None),
        "number as cell set": dataclasses.replace(whole, cell_sets={"core": 0.0}),
        "short cell mask": dataclasses.replace(whole, cell_sets={"core": np.array([True])}),
        "listed points": dataclasses.replace(whole, points=points.tolist()),
        "half precision": dataclasses.replace(whole, points=points.astype(np.float16)),
        "listed cells": dataclasses.replace(whole, hexahedra=cells.tolist()),
    }[fault]


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("coordinate", ["points", "finite"]),
        ("two-dimensional", ["points", "(12, 2)"]),
        ("seven corners", ["hexahedra", "(2, 7)", "8 nodes"]),
        ("floats as nodes", ["hexahedra", "float64", "int32"]),
        ("node beyond", ["hexahedra", "99", "12 nodes"]),
        ("node below", ["hexahedra", "-1", "12 nodes"]),
        ("cell twice", ["hexahedra", "[0, 2]", "same corners", "format 2.2"]),
        ("idle node", ["points", "12", "in no cell"]),
        ("no cell", ["hexahedra", "at least one"]),
        ("set beyond", ["node_sets['end']", "12"]),
        ("cell set beyond", ["cell_sets['core']", "2 cells"]),
        ("mask", ["node_sets['end']", "bool, shape (12,)", "np.flatnonzero"]),
        ("node twice", ["node_sets['end'] = 3", "twice", "np.unique"]),
        ("flat list", ["node_sets['end']", "list", "array"]),
        ("table", ["node_sets['end']", "shape (1, 2)", "flat"]),
        ("sets", ["node_sets", "NoneType", "dict"]),
        ("number as cell set", ["cell_sets['core']", "float", "cell indices"]),
        ("short cell mask", ["cell_sets['core']", "shape (1,)"]),
        ("listed points", ["points", "list", "float64"]),
        ("half precision", ["points", "float16", "float64"]),
        ("listed cells", ["hexahedra", "list", "int32"]),
    ],
)
def test_a_mesh_that_is_not_whole_is_refused(fault, words):
    check(broken("none"), "arm")
    with pytest.raises(RequestError) as caught:
        check(broken(fault), "arm")
    assert all(word in str(caught.value) for word in ["body arm", *words]), str(caught.value)


def test_meshes_beside_a_scene_are_checked():
    """They were taken as they came: a missing one was a KeyError, an inverted one went on to the eigenvalues."""
    body = mca.Body(name="arm", geometry=broken("none"), material=mca.Elastic(E=1e9, nu=0.3, rho=1e3))
    scene = mca.Scene(name="s", bodies=(body,), impact=mca.ImpactPhase(duration=1e-6))
    with pytest.raises(RequestError, match=r"meshes = \['leg'\]: give a mesh of body arm too"):
        mca.run(scene, meshes={"leg": broken("none")})
    inverted = dataclasses.replace(broken("none"), hexahedra=np.roll(broken("none").hexahedra, 4, axis=1))
    for act in (
        lambda: mca.run(scene, meshes={"arm": inverted}),
        lambda: mca.run_batch([scene], meshes=[{"arm": inverted}]),
    ):
        with pytest.raises(RequestError, match="body arm: 2 of 2 elements are inverted"):
            act()


def test_an_empty_set_holds_nothing():
    """A body that was fixed at an empty set flew on, without a word."""
    mesh = dataclasses.replace(broken("none"), node_sets={"root": np.zeros(0, dtype=np.int32)})
    body = mca.Body(name="arm", geometry=mesh, material=mca.Elastic(E=1e9, nu=0.3, rho=1e3))
    fixed = (mca.Fixed(body="arm", nodes="root"),)
    with pytest.raises(RequestError, match="node set = 'root': no cell has a node of it"):
        mca.run(mca.Scene(name="s", bodies=(body,), fixed=fixed, impact=mca.ImpactPhase(duration=1e-6)))


def test_a_cell_has_one_material():
    """Of two cell sets that overlap, the one that was named later won."""
    sets = {"first": np.array([0], dtype=np.int32), "both": np.array([0, 1], dtype=np.int32)}
    mesh = dataclasses.replace(broken("none"), cell_sets=sets)
    soft, hard = (mca.Elastic(E=E, nu=0.3, rho=1e3) for E in (1e6, 1e9))

    def body(**materials: mca.Elastic) -> mca.Body:
        return mca.Body(
            name="arm", geometry=mesh, material={name.replace("rest", "*"): m for name, m in materials.items()}
        )

    with pytest.raises(RequestError, match="material = 'both': some of its cells are in first too"):
        body_materials(body(first=soft, both=hard), mesh)
    for material in (
        {"first": soft, "rest": hard},
        {"rest": hard, "first": soft},
    ):  # "*" is the rest wherever it stands
        found = {m.E: cells.tolist() for m, cells in body_materials(body(**material), mesh)}
        assert found == {1e6: [0], 1e9: [1]}


def test_cells_by_mask():
    """Cut to tetrahedra, such a set held those of the first two cells."""
    whole = dataclasses.replace(broken("none"), cell_sets={"far": np.array([False, True])})
    check(whole, "arm")
    assert tetrahedral(whole).cell_sets["far"].tolist() == list(range(6, 12))


def test_fixed_sets_of_a_moving_body_may_overlap():
    """Nodes that two of them hold were refused as prescribed twice, but only where the body moved."""
    mesh = broken("none")
    body = mca.Body(name="arm", geometry=mesh, material=mca.Elastic(E=1e9, nu=0.3, rho=1e3))
    velocity = np.tile([0.0, 1.0, 0.0], (len(mesh.points), 1))

    def model(axes: str, **more) -> Model:
        fixed = tuple(mca.Fixed(body="arm", nodes=nodes, axes=axes) for nodes in ("xmin", "zmin"))
        scene = mca.Scene(name="s", bodies=(body,), fixed=fixed, impact=mca.ImpactPhase(duration=1e-6), **more)
        return build_model(scene, {"arm": mesh}, {"arm": mesh.points}, {"arm": velocity})

    found = model("yy")
    held = np.union1d(mesh.nodes("xmin"), mesh.nodes("zmin"))
    np.testing.assert_array_equal(np.sort(found.prescribed_node), held)
    assert set(found.prescribed_axis) == {1}
    assert set(found.table_value) == {1.0}
    driven = mca.Prescribed(body="arm", nodes="xmin", axis="y", times=(0.0,), velocities=(1.0,))
    with pytest.raises(RequestError, match=r"^Prescribed\.nodes = 'xmin': axis y of some .* body arm is bound twice"):
        model("y", prescribed=(driven,))
    assert len(model("x", prescribed=(driven,)).prescribed_node) == 4
