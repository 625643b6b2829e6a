"""Owns `Sphere`: a ball whose mesh is graded towards one pole, whole or cut along its planes of symmetry."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.geometry.blocks import Blocks
from warp_mca.geometry.edit import halved, mirror, pinned, snapped
from warp_mca.geometry.hemisphere import DEPTH_LIMIT, PATCH_LIMIT, Hemisphere
from warp_mca.geometry.mesh import Mesh
from warp_mca.geometry.refinement import refined_count
from warp_mca.geometry.rings import SIDES, Ring, bands, bowed_face, disc, join
from warp_mca.geometry.shape_volume import with_volumes

_CAP_ANGLE = 0.67  # half the angle that the coarse cap opposite the pole spans [rad]
_CAP_RADIUS = 0.69  # from the centre to the inner corners of that cap [radius]
_CAP_BULGE = 0.19  # of the edges between them [rad]


@dataclass(frozen=True, kw_only=True)
class Sphere:
    """A ball about the origin whose pole, a node with a fine patch around it, lies at x = radius.

    It is symmetric about y = 0 and z = 0, so that a half or a quarter with its cut faces held serves for motion that
    is symmetric too. A fine patch of section x section x ring cells is nested in a cube-sphere; nodes lie on the
    sphere, and one each exactly at its centre and at the pole.

    Node sets: surface (all of the sphere), pole (the part, about 38 degrees to each side, that may touch), and in
    parts zmin and ymin (the cut faces). Cell set: body.

    Attributes:
        radius: [m].
        part: "whole"; "half", with z >= 0; or "quarter", with y >= 0 as well.
        section: number of cells along each side of the fine patch and of the ball's core, even.
        ring: number of cells from the core to the surface, and down into the fine patch.
        pole_size: edge of the cells at the pole [m]; None: 0.28 radius / section, or what fits.
        pole_layers: number of cells from the fine patch to the coarse mesh around it.
    """

    radius: float
    part: Literal["whole", "half", "quarter"] = "whole"
    section: int = 6
    ring: int = 3
    pole_size: float | None = None
    pole_layers: int = 6

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.positive("Sphere", radius=self.radius)
        validate.even_counts("Sphere", section=self.section)
        validate.counts("Sphere", ring=self.ring, pole_layers=self.pole_layers)
        validate.choice("Sphere", ("whole", "half", "quarter"), part=self.part)
        if self.pole_size is not None:
            validate.positive("Sphere", pole_size=self.pole_size)
            if self.pole_size > self._largest_size:
                remedy = f"the fine patch is too large; give at most {self._largest_size:.3g}"
                raise bad_value("Sphere.pole_size", self.pole_size, remedy)

    @property
    def _largest_size(self) -> float:
        return self.radius * min(2.0 * PATCH_LIMIT / self.section, DEPTH_LIMIT / self.ring)

    @property
    def _size(self) -> float:
        return self.pole_size or min(0.28 * self.radius / self.section, self._largest_size)

    def refined(self, factor: float) -> Sphere:
        """The ball with cells `factor` times smaller: counts times it, `pole_size` over it or what fits then."""
        finer = replace(
            self,
            section=refined_count(self.section, factor, even=True),
            ring=refined_count(self.ring, factor),
            pole_layers=refined_count(self.pole_layers, factor),
            pole_size=None,
        )
        if self.pole_size is None:
            return finer
        return replace(finer, pole_size=min(self.pole_size / factor, finer._largest_size))

    @property
    def volume(self) -> float:
        """Of the ball, or of its part [m^3]."""
        return 4.0 / 3.0 * math.pi * self.radius**3 / {"whole": 1, "half": 2, "quarter": 4}[self.part]

    def build(self) -> Mesh:
        """The mesh: one half by gmsh, mirrored or cut."""
        mesh = self._half()
        points = snapped(snapped(mesh.points, 1, 0.0), 2, 0.0)
        skin = mesh.nodes("surface")
        points[skin] *= self.radius / np.linalg.norm(points[skin], axis=1, keepdims=True)
        points = pinned(pinned(points, (0.0, 0.0, 0.0)), (self.radius, 0.0, 0.0))
        mesh = Mesh(points, mesh.hexahedra, mesh.node_sets, {})
        if self.part == "whole":
            mesh = mirror(mesh, 2)
        if self.part == "quarter":
            mesh = halved(mesh, 1)
        cuts = {"whole": {}, "half": {"zmin": 2}, "quarter": {"zmin": 2, "ymin": 1}}[self.part]
        node_sets = {name: mesh.node_sets[name] for name in ("surface", "pole")}
        node_sets |= {name: np.flatnonzero(mesh.points[:, k] == 0.0).astype(np.int32) for name, k in cuts.items()}
        cells = np.arange(len(mesh.hexahedra), dtype=np.int32)
        return with_volumes(Mesh(mesh.points, mesh.hexahedra, node_sets, {"body": cells}), self.volume)

    def _half(self) -> Mesh:
        """The half with z >= 0."""
        blocks = Blocks("Sphere", section=self.section, ring=self.ring, pole_layers=self.pole_layers)
        equator, centre = disc(blocks, 0.0, self.radius)
        Hemisphere(
            centre=blocks.position(centre),
            radius=self.radius,
            focus=0.0,
            size=self._size,
            section=self.section,
            ring=self.ring,
            tip_layers=self.section // 2,
            focus_layers=self.pole_layers,
        ).add(blocks, equator, centre)
        self._back(blocks, equator, centre)
        mesh = blocks.mesh()
        surface = np.union1d(mesh.nodes("tip"), mesh.nodes("back")).astype(np.int32)
        return Mesh(mesh.points, mesh.hexahedra, {"surface": surface, "pole": mesh.nodes("contact")}, {})

    def _back(self, blocks: Blocks, equator: Ring, centre: int) -> None:
        """Adds the coarse hemisphere opposite the pole."""
        width = math.tan(_CAP_ANGLE)
        places = [np.array([-1.0, y * width, z * width]) for y, z in ((-1, 0), (1, 0), (1, 1), (-1, 1))]
        places = [place / np.linalg.norm(place) for place in places]
        inner = _CAP_RADIUS * self.radius
        core = bowed_face(blocks, np.zeros(3), inner * places[2], inner * places[3], _CAP_BULGE)
        cap = Ring(core, [blocks.point(self.radius * place) for place in places])
        join(blocks, cap, equator, (self.section, self.ring, self.section // 2), "body")
        blocks.block(cap.rim + cap.core, (self.section, self.section // 2, self.ring), "body")
        for a, b in (*SIDES, (0, 1)):
            blocks.arc(cap.rim[a], cap.rim[b], centre)
        for a, b in zip(cap.rim, equator.rim, strict=True):
            blocks.arc(a, b, centre)
        for face in (cap.rim, *bands(cap.rim, equator.rim)):
            blocks.name_face("back", face)
            blocks.on_sphere(face, centre)
