"""Patches of elements: compact, complete, and their sums are those of all elements around a node."""

from __future__ import annotations

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.patches import LOT, NOWHERE, PATCH, SLOTS, Patches, compact_order, grid_points, make_patches


def patch_of_elements(patches: Patches) -> np.ndarray:
    return np.repeat(np.arange(len(patches.start) - 1), np.diff(patches.start))


def patch_of_slots(patches: Patches) -> np.ndarray:
    return np.repeat(np.arange(len(patches.start) - 1), np.diff(patches.slot_start))


def nodal_sums(patches: Patches, force: np.ndarray, node_count: int) -> np.ndarray:
    """What a GPU makes of one number for each corner, shape (corners, element_count)."""
    used = patches.places != NOWHERE
    element = np.where(used, patches.start[patch_of_slots(patches)][:, None] + patches.places, 0)
    total = np.zeros(node_count)
    np.add.at(total, patches.node, np.where(used, force[np.arange(len(force)), element], 0.0).sum(axis=1))
    return total


def meshes() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    box = mca.Box(size=(1.0, 2.0, 1.0), divisions=(9, 17, 8)).build().hexahedra.T
    fan = np.array([[0, k, k + 1, 0, 500, 500 + k, 501 + k, 500] for k in range(1, 41)]).T  # wedges around a line
    return {"box": box, "fan": fan, "scattered": rng.permuted(np.arange(8 * 300)).reshape(8, 300), "one": box[:, :1]}


@pytest.mark.parametrize("name", meshes())
def test_corners_and_sums_are_those_of_the_mesh(name: str):
    """Also where many elements meet with like corners, where corners coincide, and where no elements share a node."""
    conn = np.ascontiguousarray(meshes()[name].astype(np.int32))
    patches = make_patches(conn)
    assert np.diff(patches.start).max() <= PATCH
    assert np.diff(patches.slot_start).max() <= SLOTS["mixed"]
    first = patches.slot_start[patch_of_elements(patches)]
    np.testing.assert_array_equal(patches.node[patches.corner + first], conn)
    force = np.random.default_rng(1).normal(size=conn.shape)
    expected = np.bincount(conn.ravel(), force.ravel(), minlength=conn.max() + 1)
    np.testing.assert_allclose(nodal_sums(patches, force, conn.max() + 1), expected, atol=1e-13)
    if name == "fan":
        assert np.bincount(patches.node).max() == 40  # corners of one number take a slot each
    elif name == "box":
        node = patch_of_slots(patches) * 10**6 + patches.node
        assert len(np.unique(node)) == len(node)


def test_words_hold_corners_and_materials():
    conn = np.ascontiguousarray(mca.Box(size=(1.0, 1.0, 1.0), divisions=(8, 8, 8)).build().hexahedra.T.astype(np.int32))
    patches = make_patches(conn)
    material = np.random.default_rng(2).integers(0, 1 << 28, conn.shape[1], dtype=np.int32)
    words = patches.words(material)
    np.testing.assert_array_equal(words & 0x1FF, patches.corner[0::2])
    np.testing.assert_array_equal(words >> 23, patches.corner[1::2])
    np.testing.assert_array_equal(((words[:2] >> 9) & 0x3FFF).T @ [1, 1 << 14], material)


def test_points_lie_where_the_nodes_do():
    """Far from the origin too, and whatever the size of a cell; float32 would not tell the difference."""
    mesh = mca.Box(size=(1.0, 2.0, 1.0), divisions=(9, 17, 8)).build()
    order = compact_order(mesh.points, mesh.hexahedra, PATCH)
    conn = np.ascontiguousarray(mesh.hexahedra[order].T.astype(np.int32))
    patches = make_patches(conn)
    for cell, origin in ((1.0, 0.0), (1e-6, 0.0), (1e-3, 300.0)):
        X = cell * mesh.points + origin
        points, exponent = grid_points(X, patches)
        np.testing.assert_array_equal(points[:, 3], patches.node)
        assert np.abs(points[:, :3]).max() < 1 << 28
        unit = (exponent << 23).astype(np.int32).view(np.float32).astype(float)[patch_of_elements(patches)]
        corner = points[patches.corner + patches.slot_start[patch_of_elements(patches)], :3]
        ways = (corner - corner[0]) * unit[:, None]
        np.testing.assert_allclose(ways, X[conn] - X[conn[0]], rtol=0, atol=0.6 * 2.0**-24 * cell / 8)
        np.testing.assert_array_equal(make_patches(conn, X=X).start, patches.start)


def test_patches_too_large_for_an_element_are_halved():
    """Small cells beside one a thousand times as long; without positions there is no grid to be too coarse."""
    points, cells = [], []
    for size, n in ((1.0, 1), (1e-3, 4)):
        part = mca.Box(size=(size, size, size), divisions=(n, n, n), origin=(len(points) * 1.0, 0.0, 0.0)).build()
        cells.append(part.hexahedra + sum(map(len, points)))
        points.append(part.points)
    X, conn = np.concatenate(points), np.ascontiguousarray(np.concatenate(cells).T.astype(np.int32))
    assert len(make_patches(conn).start) == 2
    patches = make_patches(conn, X=X)
    assert len(patches.start) > 2
    points, exponent = grid_points(X, patches)
    unit = np.ldexp(1.0, exponent - 127)[patch_of_elements(patches)]
    corner = points[patches.corner + patches.slot_start[patch_of_elements(patches)], :3]
    extent = np.ptp(X[conn], axis=0).max(axis=1)
    error = (corner - corner[0]) * unit[:, None] - (X[conn] - X[conn[0]])
    assert np.abs(error).max(axis=(0, 2)).max() > 0.0
    assert (np.abs(error).max(axis=(0, 2)) < 1e-6 * extent).all()


def test_compact_order_keeps_most_nodes_of_a_patch_inside_it():
    """Layers of 16 x 16 would leave 2.26 slots for each element; cubes of 128 elements 1.76 to 2."""
    mesh = mca.Box(size=(1.0, 1.0, 1.0), divisions=(16, 16, 16)).build()
    order = compact_order(mesh.points, mesh.hexahedra, PATCH)
    np.testing.assert_array_equal(np.sort(order), np.arange(len(order)))
    slots = len(make_patches(np.ascontiguousarray(mesh.hexahedra[order].T)).node) / len(order)
    as_it_comes = len(make_patches(np.ascontiguousarray(mesh.hexahedra.T)).node) / len(order)
    assert slots < 1.8 < as_it_comes


@pytest.mark.parametrize("divisions", [(16, 16, 16), (24, 24, 12), (7, 30, 30)])
def test_order_does_not_hang_on_rounding(divisions: tuple[int, int, int]):
    """Sides of equal length, and of equal cells, are cut alike when their nodes move by less than an atom's width."""
    mesh = mca.Box(size=tuple(0.001 * n for n in divisions), divisions=divisions).build()
    order = compact_order(mesh.points, mesh.hexahedra, PATCH)
    for seed in range(3):
        moved = mesh.points + np.random.default_rng(seed).uniform(-1e-13, 1e-13, mesh.points.shape)
        np.testing.assert_array_equal(compact_order(moved, mesh.hexahedra, PATCH), order)


def test_patches_are_those_of_each_scene_alone():
    """Scenes of a batch begin new patches, wherever the ranges that are computed together end."""
    count, ends = 3 * LOT + 40, (LOT - 5, 2 * LOT + 77, 3 * LOT + 40)
    conn = np.random.default_rng(4).integers(0, 5000, (8, count)).astype(np.int32)
    conn[:, LOT:] = np.arange(8)[:, None] + np.arange(count - LOT) // 3  # patches with few nodes, and with too many
    joined = make_patches(conn, ends)
    first = slots = 0
    for begin, end in zip((0, *ends), ends, strict=False):
        alone = make_patches(conn[:, begin:end])
        patches, nodes = len(alone.start) - 1, len(alone.node)
        np.testing.assert_array_equal(joined.start[first : first + patches + 1], alone.start + begin)
        np.testing.assert_array_equal(joined.slot_start[first : first + patches + 1], alone.slot_start + slots)
        np.testing.assert_array_equal(joined.node[slots : slots + nodes], alone.node)
        np.testing.assert_array_equal(joined.corner[:, begin:end], alone.corner)
        np.testing.assert_array_equal(joined.places[slots : slots + nodes], alone.places)
        first, slots = first + patches, slots + nodes


def test_elements_of_a_model_come_patch_by_patch():
    scene = mca.Scene(
        name="bar",
        bodies=(
            mca.Body(
                name="bar",
                geometry=mca.Box(size=(0.1, 0.1, 0.1), divisions=(8, 8, 8)),
                material=mca.Elastic(E=2e11, nu=0.3, rho=7850.0),
            ),
        ),
        impact=mca.ImpactPhase(duration=1e-6),
    )
    from warp_mca.model import build_model

    meshes = mca.mesh(scene)
    X = meshes["bar"].points
    model = build_model(scene, meshes, {"bar": X}, {"bar": np.zeros_like(X)})
    np.testing.assert_array_equal(model.blocks[0].conn.T, meshes["bar"].hexahedra[model.element_of])
    assert not np.array_equal(model.element_of, np.arange(512))


def test_patches_that_yield_come_first_in_the_order_they_lie_in():
    """The kernels run on any device; a thread that starts behind the end has nothing to do."""
    import warp as wp

    from warp_mca.kernels import patch

    for count in (1, 5, 256, 1000):
        flowing = np.random.default_rng(count).integers(0, 4, count) * np.random.default_rng(7).integers(0, 2, count)
        with wp.ScopedDevice("cpu"):
            given, turn = wp.array(flowing, dtype=wp.int32), wp.zeros(count, dtype=wp.vec4i)
            head = wp.array(np.arange(4 * count).reshape(-1, 4), dtype=wp.vec4i)
            sums = wp.zeros(patch.SCHEDULERS, dtype=wp.int32)
            wp.launch(patch.count_flowing, patch.SCHEDULERS, inputs=[given], outputs=[sums])
            wp.launch(patch.schedule, patch.SCHEDULERS, inputs=[given, sums, head], outputs=[turn])
        expected = np.concatenate([np.flatnonzero(flowing > 0), np.flatnonzero(flowing == 0)])
        np.testing.assert_array_equal(turn.numpy(), head.numpy()[expected])
