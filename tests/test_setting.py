"""Tests what stands around bodies in pictures: which way is up, where the viewer stands, rigid planes."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from flying_bars import FlyingBars

import warp_mca as mca
from warp_mca.base.errors import RequestError
from warp_mca.pictures.setting import plane_mesh, rigid_planes, up_of, view_axes

FLOOR = mca.RigidPlane(point=(0.0, 0.0, -0.01), normal=(0.0, 0.0, 2.0))


def contact(master: mca.RigidPlane) -> mca.Contact:
    return mca.Contact(slave=mca.Surface(body="lower", nodes="ymin"), master=master)


def test_scene_then_gravity_then_a_plane_say_what_is_up(bars: FlyingBars):
    plain = bars.info.scene
    on_floor = dataclasses.replace(plain, contacts=(contact(FLOOR),))
    falling = dataclasses.replace(on_floor, gravity=(-9.81, 0.0, 0.0))
    told = dataclasses.replace(falling, up=(0.0, -3.0, 0.0))
    expected = ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0))
    for scene, up in zip((plain, on_floor, falling, told), expected, strict=True):
        np.testing.assert_allclose(up_of(scene), up, atol=1e-15)
    with pytest.raises(RequestError, match=r"Scene.up = \(0.0, 0.0, 0.0\): give a direction other than zero"):
        dataclasses.replace(plain, up=(0, 0, 0))


@pytest.mark.parametrize("up", [(0, 1, 0), (0, 0, 1), (1, 0, 0), (0, 0, -1), (0.6, 0.0, 0.8), (0, -1, 0)])
def test_axes_of_the_view_are_right_handed(up: tuple[float, float, float]):
    axes = view_axes(np.array(up, dtype=float))
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    np.testing.assert_array_equal(axes[1], up)


def test_deep_bodies_are_looked_at_from_the_side():
    up = np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose(view_axes(up, np.array([1.0, 0.1, 0.1])), [[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    np.testing.assert_allclose(view_axes(up, np.array([0.1, 1.0, 0.1])), [[0, 1, 0], [0, 0, 1], [1, 0, 0]])


def test_a_plane_reaches_beyond_the_bodies_and_faces_its_free_side():
    points = np.random.default_rng(1).uniform(-0.1, 0.2, (50, 3))
    plane = mca.RigidPlane(point=(0.0, 0.1, 0.0), normal=(1.0, 2.0, 3.0))
    mesh = plane_mesh(plane, points, np.array([0.0, 0.0, 1.0]))
    normal = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
    np.testing.assert_allclose((mesh.points - plane.point) @ normal, 0.0, atol=1e-15)
    a, b, c, d = (mesh.points[mesh.quads[:, k]] for k in range(4))
    area = np.cross(c - a, d - b)
    np.testing.assert_allclose(area / np.linalg.norm(area, axis=1)[:, None], np.tile(normal, (len(area), 1)), atol=1e-9)
    across = np.linalg.svd(normal[None])[2][1:]  # two directions in the plane
    for direction in across:
        low, high = (mesh.points @ direction).min(), (mesh.points @ direction).max()
        assert low < (points @ direction).min() and (points @ direction).max() < high


def test_neighbouring_squares_differ():
    mesh = plane_mesh(FLOOR, np.random.default_rng(1).uniform(0.0, 0.1, (50, 3)), np.array([0.0, 0.0, 1.0]))
    edges = np.sort(np.stack([mesh.quads, np.roll(mesh.quads, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    owner = np.repeat(np.arange(len(mesh.quads)), 4)
    order = np.lexsort(edges.T)
    shared = np.flatnonzero((edges[order][1:] == edges[order][:-1]).all(axis=1))
    assert len(shared) > 100
    assert (mesh.dark[owner[order[shared]]] != mesh.dark[owner[order[shared + 1]]]).all()


def test_the_pattern_moves_with_the_belt_and_repeats():
    belt = dataclasses.replace(FLOOR, velocity=(0.3, 0.4, 0.0))
    mesh = plane_mesh(belt, np.random.default_rng(1).uniform(0.0, 0.1, (50, 3)), np.array([0.0, 0.0, 1.0]))
    assert mesh.moves
    time = 0.4 * mesh.period / 0.5
    np.testing.assert_allclose(mesh.shift(time), np.array(belt.velocity) * time)
    np.testing.assert_allclose(mesh.shift(time + 6.0 * mesh.period), mesh.shift(time + 4.0 * mesh.period), atol=1e-12)
    moved = {tuple(np.round(p, 9)) for p in mesh.points + belt.velocity * np.full(3, mesh.period / 0.5)}
    kept = moved & {tuple(np.round(p, 9)) for p in mesh.points}
    assert len(kept) > 0.7 * len(moved)  # after a period its corners lie on corners


def test_a_plane_that_several_contacts_share_is_one(bars: FlyingBars):
    other = mca.Contact(slave=mca.Surface(body="upper bar", nodes="ymin"), master=FLOOR)
    scene = dataclasses.replace(bars.info.scene, contacts=(contact(FLOOR), other))
    assert rigid_planes(scene) == [FLOOR]
