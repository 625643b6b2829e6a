"""Patches of elements: compact, complete, and their sums are those of all elements around a node."""

from __future__ import annotations

import itertools
from types import SimpleNamespace

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.physics.elements.patches import (
    NOWHERE,
    PATCH,
    SLOTS,
    SORT_CHUNK,
    Patches,
    compact_order,
    grid_points,
    make_patches,
)


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


def test_grids_are_those_of_each_scene_alone():
    """Also where patches are halved for their grids, and beyond the elements that are computed together."""
    rng = np.random.default_rng(5)
    counts, node_counts = (SORT_CHUNK + 300, 700, 2 * SORT_CHUNK - 50), (3000, 400, 5000)
    ends, nodes = np.cumsum(counts), np.cumsum([0, *node_counts])
    Xs = [rng.normal(size=(n, 3)) * 10.0 ** rng.uniform(-4, 1, (n, 1)) for n in node_counts]
    conns = [rng.integers(0, n, (8, count)).astype(np.int32) for n, count in zip(node_counts, counts, strict=True)]
    shifted = [conn + np.int32(first) for conn, first in zip(conns, nodes, strict=False)]
    X = np.concatenate(Xs)
    joined = make_patches(np.concatenate(shifted, axis=1), ends.tolist(), X=X)
    single = [make_patches(conn, X=x) for conn, x in zip(conns, Xs, strict=True)]
    assert len(joined.start) > len(make_patches(np.concatenate(shifted, axis=1), ends.tolist()).start)
    points, exponent = grid_points(X, joined)
    grids = [grid_points(x, patches) for x, patches in zip(Xs, single, strict=True)]
    np.testing.assert_array_equal(points[:, :3], np.concatenate([own[:, :3] for own, _ in grids]))
    np.testing.assert_array_equal(exponent, np.concatenate([own for _, own in grids]))
    np.testing.assert_array_equal(joined.places, np.concatenate([patches.places for patches in single]))


def test_heads_hold_what_kernels_read_from_them():
    """Bits as `kernels/elements/patch.py` takes them apart; and the widths that they need."""
    conn = np.ascontiguousarray(mca.Box(size=(1.0, 2.0, 1.0), divisions=(9, 17, 8)).build().hexahedra.T)
    patches = make_patches(conn.astype(np.int32))
    exponent = np.arange(len(patches.start) - 1, dtype=np.int32) + 245
    head = patches.heads(exponent)
    np.testing.assert_array_equal(head[:, 0], patches.start[:-1])
    np.testing.assert_array_equal(head[:, 1], patches.slot_start[:-1])
    np.testing.assert_array_equal(head[:, 2] & 0xFF, np.diff(patches.start))
    np.testing.assert_array_equal((head[:, 2] >> 8) & 0xFF, exponent)
    np.testing.assert_array_equal(head[:, 2] >> 16, np.diff(patches.slot_start))
    np.testing.assert_array_equal(head[:, 3], np.arange(len(head)))
    assert max(SLOTS.values()) < 1 << 9 and PATCH < 256


@pytest.mark.parametrize("edge", [2.0, np.nextafter(2.0, 0.0), 1.7, 3e-9])
def test_sums_over_the_corners_of_an_element_fit_32_bits(edge: float):
    """An element as large as its patch, just below a power of two: `hex8r` adds up to eight of its places."""
    X = edge * mca.Box(size=(1.0, 1.0, 1.0), divisions=(1, 1, 1)).build().points
    points, exponent = grid_points(X, make_patches(np.arange(8, dtype=np.int32)[:, None], X=X))
    assert 8 * np.abs(points[:, :3].astype(np.int64)).max() < 1 << 31
    assert np.abs(points[:, :3]).max() > 1 << 26  # and the grid is as fine as that allows, to a bit
    assert 0 < exponent[0] < 255


def test_elements_leave_room_for_contact():
    from warp_mca.physics.elements.patch_stage import PatchStage

    for patches, blocks in itertools.product((1, 40, 528, 1229, 7814), (1, 19, 64, 5000)):
        stage = object.__new__(PatchStage)
        stage.most, stage.patches = 528, SimpleNamespace(head=range(patches))
        stage.make_room(blocks)
        assert min(patches, 264) <= stage.blocks <= min(patches, 527)
        assert patches > 2000 or blocks > 264 or stage.blocks == min(patches, 528 - blocks)


def test_small_models_have_smaller_patches():
    """6,144 hexahedra on 132 multiprocessors: 96 patches of 64; a few more elements would leave no room for others."""
    from warp_mca.physics.elements.patch_stage import patch_size

    assert [patch_size(n, 132) for n in (1, 6144, 6336, 6337, 158080)] == [64, 64, 64, PATCH, PATCH]
    conn = meshes()["box"]
    assert np.array_equal(make_patches(conn, size=64).start, [*range(0, conn.shape[1], 64), conn.shape[1]])


def test_patches_are_those_of_each_scene_alone():
    """Scenes of a batch begin new patches, wherever the ranges that are computed together end."""
    count, ends = 3 * SORT_CHUNK + 40, (SORT_CHUNK - 5, 2 * SORT_CHUNK + 77, 3 * SORT_CHUNK + 40)
    conn = np.random.default_rng(4).integers(0, 5000, (8, count)).astype(np.int32)
    conn[:, SORT_CHUNK:] = (
        np.arange(8)[:, None] + np.arange(count - SORT_CHUNK) // 3
    )  # patches with few nodes, and with too many
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
    from warp_mca.model.build import build_model

    meshes = mca.mesh(scene)
    X = meshes["bar"].points
    model = build_model(scene, meshes, {"bar": X}, {"bar": np.zeros_like(X)})
    np.testing.assert_array_equal(model.blocks[0].conn.T, meshes["bar"].hexahedra[model.element_of])
    assert not np.array_equal(model.element_of, np.arange(512))


def test_patches_that_yield_come_first_in_the_order_they_lie_in():
    """The kernels run on any device; a thread that starts behind the end has nothing to do."""
    import warp as wp

    from warp_mca.kernels.elements import patch

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
