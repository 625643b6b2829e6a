"""Owns the sides of a surface: its smooth parts, told apart where they meet at a sharp edge."""

from __future__ import annotations

import math

import numpy as np

from warp_mca.base.arrays import Array, Index

SHARP = math.cos(math.radians(50.0))  # between the normals of faces that meet at a sharp edge, at most
BENT = math.cos(math.radians(0.1))  # between the normals of neighbouring faces of a flat surface, at least
MAX_SIDES = 6  # of a surface; where rough faces need more, sides share numbers


def face_geometry(X: Array, face: Index) -> tuple[Array, Array]:
    """Areas [m^2], shape (face_count,), and area-weighted normals [m^2], shape (face_count, 3), of bilinear faces."""
    a, b, c, d = (X[face[:, k]] for k in range(4))
    normal = 0.5 * np.cross(c - a, d - b)
    return np.linalg.norm(normal, axis=1), normal


def neighbours(face: Index) -> tuple[Index, Index, Index]:
    """Pairs of faces that share an edge, two arrays of shape (pair_count,), and its nodes, shape (pair_count, 2)."""
    corner, following = face.ravel(), np.roll(face, -1, axis=1).ravel()
    edge = np.sort(np.column_stack([corner, following]), axis=1)
    owner = np.repeat(np.arange(len(face), dtype=np.int32), 4)
    real = corner != following  # a triangle has three
    edge, owner = edge[real], owner[real]
    order = np.lexsort((edge[:, 1], edge[:, 0]))
    edge, owner = edge[order], owner[order]
    same = (edge[1:] == edge[:-1]).all(axis=1)
    return owner[:-1][same], owner[1:][same], edge[1:][same]


def _edges(face: Index, normal: Array) -> tuple[Index, Index, Array]:
    """Pairs of faces that share an edge, and the cosine between their normals, shape (pair_count,)."""
    first, second, _ = neighbours(face)
    unit = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    return first, second, (unit[first] * unit[second]).sum(axis=1)


def find_sides(face: Index, normal: Array) -> Index:
    """Side of each face, shape (face_count,), int32, from 0 on; all are 0 where no edge is sharp.

    Faces that share an edge are on one side, unless their normals differ by more than 50 degrees. Parts that share a
    node get different numbers, since all of them may press a node that a corner meets; others may get the same, as
    opposite ones of a box do, so that three or four numbers are enough, and never more than `MAX_SIDES`.

    Args:
        face: corners of each face, shape (face_count, 4), int32; triangles have their last one twice.
        normal: of each face, of any length, shape (face_count, 3).
    """
    first, second, cosine = _edges(face, normal)
    sharp = cosine < SHARP
    if not sharp.any():
        return np.zeros(len(face), dtype=np.int32)
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    smooth = np.ones(int((~sharp).sum())), (first[~sharp], second[~sharp])
    count, part = connected_components(coo_array(smooth, shape=(len(face), len(face))), directed=False)
    at_node = np.unique(np.column_stack([face.ravel(), np.repeat(part, 4)]), axis=0)
    meets: list[set[int]] = [set() for _ in range(count)]
    for parts in np.split(at_node[:, 1], np.flatnonzero(np.diff(at_node[:, 0])) + 1):
        if len(parts) > 1:
            for p in parts.tolist():
                meets[p].update(parts.tolist())
    number = np.full(count, -1, dtype=np.int32)
    for p in np.argsort(-np.bincount(part), kind="stable"):
        taken = {int(number[q]) for q in meets[p]}
        number[p] = next((k for k in range(MAX_SIDES) if k not in taken), p % MAX_SIDES)
    return number[part]


def is_curved(face: Index, normal: Array) -> bool:
    """Whether neighbouring faces of a surface differ in their normals by more than BENT without a sharp edge between.

    Args:
        face, normal: as of `find_sides`.
    """
    _, _, cosine = _edges(face, normal)
    return bool(((cosine >= SHARP) & (cosine < BENT)).any())


def stiffest_edge(face: Index, normal: Array) -> float:
    """How many times stiffer than one spring the two that press a node at once are together: 1 + |n1 . n2|, at most.

    Both sides of a sharp edge press a node in a fold, and one that meets the edge of a solid head-on.

    Args:
        face, normal: as of `find_sides`.
    """
    _, _, cosine = _edges(face, normal)
    return 1.0 + float(np.abs(cosine[cosine < SHARP]).max(initial=0.0))
