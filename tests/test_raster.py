"""Tests the depth buffer: which pixels triangles cover, which of them is nearest, values between corners."""

from __future__ import annotations

import numpy as np

from warp_mca.geometry.creases import Creases
from warp_mca.geometry.sphere import Sphere
from warp_mca.pictures.raster import rasterise


def test_triangles_of_a_square_cover_each_of_its_pixels_once():
    a, b, c, d = [2.0, 3.0, 0.0], [9.0, 3.0, 0.0], [9.0, 8.0, 0.0], [2.0, 8.0, 0.0]
    one, other = rasterise(np.array([[a, b, c]]), 12, 10).pixel, rasterise(np.array([[a, c, d]]), 12, 10).pixel
    assert not set(one) & set(other)
    expected = {12 * j + k for j in range(3, 8) for k in range(2, 9)}
    assert set(one) | set(other) == expected


def test_the_nearest_triangle_is_seen_also_where_two_cross():
    tilted = np.array([[[0.0, 0.0, -1.0], [20.0, 0.0, 1.0], [0.0, 20.0, -1.0]]])  # z = x / 10 - 1
    level = np.array([[[0.0, 0.0, 0.0], [20.0, 0.0, 0.0], [0.0, 20.0, 0.0]]])
    seen = rasterise(np.concatenate([tilted, level]), 20, 20)
    np.testing.assert_array_equal(seen.triangle == 0, seen.pixel % 20 + 0.5 > 10.0)


def test_values_are_linear_between_corners():
    corners = np.random.default_rng(4).uniform(-5.0, 45.0, (6, 3, 3))
    seen = rasterise(corners, 40, 30)
    x, y = seen.pixel % 40 + 0.5, seen.pixel // 40 + 0.5
    found = seen.interpolated(np.stack([corners[:, :, 0], corners[:, :, 1]], axis=2))
    np.testing.assert_allclose(found, np.stack([x, y], axis=1), atol=1e-9)
    assert (seen.weight > -1e-9).all()


def test_large_pictures_are_looked_at_in_parts(monkeypatch):
    corners = np.random.default_rng(5).uniform(0.0, 60.0, (40, 3, 3))
    whole = rasterise(corners, 60, 60)
    monkeypatch.setattr("warp_mca.pictures.raster.AT_ONCE", 50)
    parts = rasterise(corners, 60, 60)
    np.testing.assert_array_equal(whole.pixel, parts.pixel)
    np.testing.assert_array_equal(whole.triangle, parts.triangle)


def test_normals_keep_the_edges_of_a_cube():
    points = np.array([[x, y, z] for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0)])
    quads = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]], np.int32)
    normals, corner = Creases(quads, points).by_triangle(points)
    a, b, c = (points[corner[:, k]] for k in range(3))
    faces = np.cross(b - a, c - a)
    np.testing.assert_allclose(normals, np.repeat(faces[:, None], 3, axis=1), atol=1e-7)


def test_normals_are_smooth_over_a_ball_and_follow_a_turn():
    mesh = Sphere(radius=1.0, section=8).build()
    quads = mesh.boundary[0]
    nodes = np.unique(quads)
    points, local = mesh.points[nodes], np.searchsorted(nodes, quads).astype(np.int32)
    creases = Creases(local, points)
    assert creases.count == len(points)  # one normal for each vertex
    normals = creases.normals(points)
    at = np.zeros((creases.count, 3))
    at[creases.group] = points[local].reshape(-1, 3)
    assert (np.einsum("ij,ij->i", normals, at) > np.cos(np.radians(4.0))).all()
    small, large = (
        np.array([[np.cos(t), -np.sin(t), 0.0], [np.sin(t), np.cos(t), 0.0], [0.0, 0.0, 1.0]]) for t in (0.05, 0.1)
    )
    assert creases.normals(points @ small.T) is None
    np.testing.assert_allclose(creases.normals(points @ large.T), normals @ large.T, atol=1e-6)
