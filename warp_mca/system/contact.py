"""Owns the tables of a general contact: which bodies it keeps apart, and the faces that a node never meets."""

from __future__ import annotations

from dataclasses import dataclass

from warp_mca.base.arrays import Array, Index

SLOTS = 2  # bodies for which a node at a sharp edge has springs of their own


@dataclass(frozen=True, kw_only=True)
class Pairs:
    """Bodies of a general contact, numbered within their scene.

    Attributes:
        body: of each slave node, shape (slave_count,), int32.
        face: body of each face, shape (face_count,), int32.
        factor: of the stiffness of springs between two bodies [-], 0 where they do not meet, shape (body_count,
            body_count), float64.
        barred_offset, barred: faces of its own body that each slave node never meets, compressed rows, int32.
    """

    body: Index
    face: Index
    factor: Array
    barred_offset: Index
    barred: Index
