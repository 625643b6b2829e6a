"""Owns `Rod`: a round rod with a flat or hemispherical tip, refined around one point of the hemisphere."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.geometry.blocks import Blocks
from warp_mca.geometry.edit import mirror, pinned, snapped
from warp_mca.geometry.hemisphere import DEPTH_LIMIT, FOCUS_LIMIT, PATCH_LIMIT, Hemisphere
from warp_mca.geometry.mesh import Mesh
from warp_mca.geometry.refinement import refined_count
from warp_mca.geometry.rings import bands, disc, join
from warp_mca.geometry.shape_volume import with_volumes

_FOCUS_SIZE = 0.28  # default edge of the fine cells, times the cells along the section's core [radius]


@dataclass(frozen=True, kw_only=True)
class Rod:
    """A rod along +x from a hinge at the origin, whose axis is z, to its tip at x = length; symmetric about z = 0.

    The section is a four-sided core inside a ring; the z axis is a line of its nodes, the same in all rods of equal
    radius, section and ring. A hemispherical tip has a fine patch of section x section x ring cells around the focus,
    a node on the sphere in the plane z = 0.

    Node sets: start (x = 0), side (cylinder), end (flat tip), or tip (hemisphere with its equator) and contact (the
    part of the sphere, about 38 degrees to each side, that faces the focus). Cell sets: body, and tip (hemisphere).

    Attributes:
        radius: [m].
        length: from the hinge axis to the end of the tip [m].
        tip: shape of the free end.
        section: number of cells along each side of the section's core, even.
        ring: number of cells from the core to the surface, and down into the fine patch.
        axial: number of cells along the cylinder.
        axial_ratio: length of the cells at the hinge over that of the cells at the tip.
        tip_layers: number of cells from the equator to the cap of the tip; None: half of `section`.
        focus_angle: from the rod's axis to the focus, positive towards +y [rad], at most 60 degrees either way.
        focus_size: edge of the cells at the focus [m]; None: 0.28 radius / section, or what fits.
        focus_layers: number of cells from the fine patch to the coarse mesh around it.
    """

    radius: float
    length: float
    tip: Literal["flat", "hemisphere"] = "hemisphere"
    section: int = 6
    ring: int = 3
    axial: int = 16
    axial_ratio: float = 1.0
    tip_layers: int | None = None
    focus_angle: float = 0.0
    focus_size: float | None = None
    focus_layers: int = 4

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.positive("Rod", radius=self.radius, length=self.length, axial_ratio=self.axial_ratio)
        if not 1e-6 <= self.axial_ratio <= 1e6:
            raise bad_value("Rod.axial_ratio", self.axial_ratio, "give a ratio between 1e-6 and 1e6")
        validate.even_counts("Rod", section=self.section)
        validate.counts("Rod", ring=self.ring, axial=self.axial, focus_layers=self.focus_layers)
        validate.finite("Rod", focus_angle=self.focus_angle)
        validate.choice("Rod", ("flat", "hemisphere"), tip=self.tip)
        if self.tip_layers is not None:
            validate.counts("Rod", tip_layers=self.tip_layers)
        if self.tip == "hemisphere":
            self._check_hemisphere()

    def _check_hemisphere(self) -> None:
        if self.length <= self.radius:
            raise bad_value("Rod.length", self.length, f"a hemispherical tip needs more than radius = {self.radius:g}")
        if abs(self.focus_angle) > FOCUS_LIMIT * (1.0 + 1e-12):
            raise bad_value("Rod.focus_angle", self.focus_angle, f"must lie within {FOCUS_LIMIT:.4f} rad either way")
        validate.positive("Rod", focus_size=self._focus_size)
        if self._focus_size > self._largest_focus_size:
            remedy = f"the fine patch is too large; give at most {self._largest_focus_size:.3g}"
            raise bad_value("Rod.focus_size", self._focus_size, remedy)

    @property
    def _largest_focus_size(self) -> float:
        return self.radius * min(2.0 * PATCH_LIMIT / self.section, DEPTH_LIMIT / self.ring)

    @property
    def _focus_size(self) -> float:
        if self.focus_size is not None:
            return self.focus_size
        return min(_FOCUS_SIZE * self.radius / self.section, self._largest_focus_size)

    @property
    def _cylinder(self) -> float:
        """Length of the cylinder [m]."""
        return self.length - self.radius if self.tip == "hemisphere" else self.length

    def refined(self, factor: float) -> Rod:
        """The rod with cells `factor` times smaller: counts times it, `focus_size` over it or what fits then."""
        finer = replace(
            self,
            section=refined_count(self.section, factor, even=True),
            ring=refined_count(self.ring, factor),
            axial=refined_count(self.axial, factor),
            tip_layers=None if self.tip_layers is None else refined_count(self.tip_layers, factor),
            focus_layers=refined_count(self.focus_layers, factor),
            focus_size=None,
        )
        if self.focus_size is None:
            return finer
        return replace(finer, focus_size=min(self.focus_size / factor, finer._largest_focus_size))

    @property
    def volume(self) -> float:
        """Of the rod [m^3]."""
        return sum(self._volumes.values())

    @property
    def _volumes(self) -> dict[str, float]:
        """Of the shape in each cell set [m^3]."""
        found = {"body": math.pi * self.radius**2 * self._cylinder}
        return found | ({"tip": 2.0 / 3.0 * math.pi * self.radius**3} if self.tip == "hemisphere" else {})

    def build(self) -> Mesh:
        """The mesh: one half by gmsh, mirrored; the nodes that others rely on are put exactly in their places."""
        mesh = mirror(self._half(), 2)
        points = mesh.points
        if self.tip == "hemisphere":
            points = self._rounded(points, mesh.nodes("tip"))
        for axis, place in ((0, 0.0), (0, self._cylinder), (0, self.length), (1, 0.0)):
            points = snapped(points, axis, place)
        return with_volumes(Mesh(points, mesh.hexahedra, mesh.node_sets, mesh.cell_sets), self._volumes)

    def _rounded(self, points: NDArray[np.float64], tip: NDArray[np.int32]) -> NDArray[np.float64]:
        """Points with the tip's nodes on the sphere, and one node each at its centre and at the focus."""
        centre = np.array([self._cylinder, 0.0, 0.0])
        if self.focus_angle < 0.0:
            points = points * [1.0, -1.0, -1.0] + 0.0  # half a turn about the axis; adding 0 turns -0 into 0
        arms = points[tip] - centre
        points[tip] = centre + arms * (self.radius / np.linalg.norm(arms, axis=1, keepdims=True))
        outwards = np.array([math.cos(self.focus_angle), math.sin(self.focus_angle), 0.0])
        return pinned(pinned(points, centre), centre + self.radius * outwards)

    def _half(self) -> Mesh:
        """The half with z >= 0, its focus turned to y >= 0."""
        blocks = Blocks(
            "Rod",
            section=self.section,
            ring=self.ring,
            axial=self.axial,
            tip_layers=self.tip_layers or 0,
            focus_layers=self.focus_layers,
        )
        start, _ = disc(blocks, 0.0, self.radius)
        end, centre = disc(blocks, self._cylinder, self.radius)
        join(blocks, start, end, (self.section, self.ring, self.axial), "body")
        factor = self.axial_ratio ** (-1.0 / max(self.axial - 1, 1))
        for a, b in zip(start.core + start.rim, end.core + end.rim, strict=True):
            blocks.grow(a, b, factor)

        sets = {"start": [start.core, *start.faces()], "side": bands(start.rim, end.rim)}
        if self.tip == "flat":
            sets["end"] = [end.core, *end.faces()]
        for name, faces in sets.items():
            for face in faces:
                blocks.name_face(name, face)
        if self.tip == "hemisphere":
            Hemisphere(
                centre=blocks.position(centre),
                radius=self.radius,
                focus=abs(self.focus_angle),
                size=self._focus_size,
                section=self.section,
                ring=self.ring,
                tip_layers=self.tip_layers or self.section // 2,
                focus_layers=self.focus_layers,
            ).add(blocks, end, centre)
        return blocks.mesh()
