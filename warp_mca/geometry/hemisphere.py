"""Owns the blocks of a rod's hemispherical tip: half a cube-sphere with a fine patch nested in its cap."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from warp_mca.geometry.blocks import Blocks, growth
from warp_mca.geometry.rings import SIDES, Ring, Vector, bands, bowed_face, join

# Found by search for a good worst corner and a long stable step, at focus angles 0, 36 and 60 degrees together.
_CAP_SPAN = 0.66  # half the angle that the cap spans in the plane z = 0 [rad]
_CAP_SIDE = 0.67  # half the angle that it spans across [rad]
_CAP_LIMITS = 0.1, 1.38  # beyond these angles its far and near edge do not follow the focus [rad]
_CAP_RADIUS = 0.69  # from the sphere's centre to the inner corners of the cap [radius]
_CAP_LIFT = 0.24  # by which the near ones move out when the near edge stays behind [radius/rad]
_CAP_BULGE = 0.19  # of the edges between them [rad]
_FINE_DEPTH = 1.15  # depth of the fine cells over their edge
_FINE_LEAN = 0.105  # by which the sides of the fine patch lean in downwards [rad]
_FINE_BULGE = 0.16  # of its inner edges [rad]
_FIRST_STEP = 1.5  # growth towards the coarse mesh starts from this many fine edges

FOCUS_LIMIT = math.radians(60.0)  # largest focus angle
PATCH_LIMIT = 0.17  # largest half-width of the fine patch [rad]
DEPTH_LIMIT = 0.2 / _FINE_DEPTH  # largest depth of the fine patch, counted in fine edges [radius]


@dataclass(frozen=True)
class Hemisphere:
    """Sizes and counts of the tip.

    Attributes:
        centre: of the sphere [m], shape (3,), float64.
        radius: of the sphere [m].
        focus: focus_angle of `Rod`, but not negative [rad].
        size: focus_size of `Rod` [m].
        section, ring, tip_layers, focus_layers: as in `Rod`.
    """

    centre: Vector
    radius: float
    focus: float
    size: float
    section: int
    ring: int
    tip_layers: int
    focus_layers: int

    def add(self, blocks: Blocks, equator: Ring, centre: int) -> None:
        """Adds the tip's blocks on the ring `equator` about the point `centre`."""
        cap, fine = self._cap(blocks), self._fine(blocks)
        join(blocks, equator, cap, (self.section, self.ring, self.tip_layers), "tip")
        join(blocks, fine, cap, (self.section, self.ring, self.focus_layers), "tip")
        blocks.block(fine.core + fine.rim, (self.section, self.section // 2, self.ring), "tip")
        self._grow(blocks, fine, cap)

        for rim in (fine.rim, cap.rim):
            for a, b in (*SIDES, (0, 1)):
                blocks.arc(rim[a], rim[b], centre)
        for a, b in zip(fine.rim + equator.rim, cap.rim * 2, strict=True):
            blocks.arc(a, b, centre)
        contact = [fine.rim, *bands(fine.rim, cap.rim)]
        for name, faces in (("contact", contact), ("tip", contact + bands(equator.rim, cap.rim))):
            for face in faces:
                blocks.name_face(name, face)
                blocks.on_sphere(face, centre)

    def _cap(self, blocks: Blocks) -> Ring:
        """The cap that closes the half cube, turned towards the focus as far as the limits allow."""
        far = min(self.focus - _CAP_SPAN, _CAP_LIMITS[0])
        near = min(self.focus + _CAP_SPAN, _CAP_LIMITS[1])
        rim = _patch(0.5 * (near + far), math.tan(0.5 * (near - far)), math.tan(_CAP_SIDE))
        lifted = _CAP_RADIUS + _CAP_LIFT * (self.focus + _CAP_SPAN - near)
        inner = lifted * self.radius * rim[2], _CAP_RADIUS * self.radius * rim[3]
        core = bowed_face(blocks, self.centre, *inner, _CAP_BULGE)
        return Ring(core, [blocks.point(self.centre + self.radius * place) for place in rim])

    def _fine(self, blocks: Blocks) -> Ring:
        """The fine patch: its rim lies on the sphere, its core below."""
        width = math.tan(0.5 * self.section * self.size / self.radius)
        rim = _patch(self.focus, width, width)
        outwards, along = _axes(self.focus)
        depth = _FINE_DEPTH * self.ring * self.size
        lean = depth * math.tan(_FINE_LEAN)
        heart = (self.radius - 0.5 * depth) * outwards
        below = [self.radius * place - depth * outwards - heart - [0.0, 0.0, lean] for place in rim[2:]]
        core = bowed_face(blocks, self.centre + heart, below[0] - lean * along, below[1] + lean * along, _FINE_BULGE)
        return Ring(core, [blocks.point(self.centre + self.radius * place) for place in rim])

    def _grow(self, blocks: Blocks, fine: Ring, cap: Ring) -> None:
        """Lets the cells grow outwards along each edge; edges off two or three planes start that much longer."""
        for inner, outer, planes in ((fine.core, cap.core, 2), (fine.rim, cap.rim, 1)):
            for i, (a, b) in enumerate(zip(inner, outer, strict=True)):
                length = float(np.linalg.norm(blocks.position(b) - blocks.position(a)))
                before = _FIRST_STEP * self.size * math.sqrt(planes + (i >= 2))
                blocks.grow(a, b, growth(length, self.focus_layers, before))


def _axes(angle: float) -> tuple[Vector, Vector]:
    """Unit vectors in the plane z = 0 towards `angle` from x, and square to it towards y."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([c, s, 0.0]), np.array([-s, c, 0.0])


def _patch(angle: float, half_along: float, half_across: float) -> list[Vector]:
    """Unit vectors to the corners of a patch about `angle`, of the given tangents, in the order of `Ring.rim`."""
    outwards, along = _axes(angle)
    across = np.array([0.0, 0.0, 1.0])
    signs = ((-1, 0), (1, 0), (1, 1), (-1, 1))
    arms = [outwards + a * half_along * along + b * half_across * across for a, b in signs]
    return [arm / np.linalg.norm(arm) for arm in arms]
