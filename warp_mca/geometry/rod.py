"""Owns `Rod`: a round rod with a flat or hemispherical tip, refined around one point of the hemisphere."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from warp_mca.errors import bad_value
from warp_mca.geometry import _validate
from warp_mca.geometry.blocks import Blocks, growth
from warp_mca.geometry.edit import mirror, pinned, snapped
from warp_mca.geometry.mesh import Mesh

# Block corners, as shares of the radius or angles [rad]. Found by search for the best worst corner.
S = dict(
 CORE_RADIUS = 0.58,  # from the axis to a corner of the section's core
 CORE_BULGE = math.radians(10.0),  # by which the core's edges leave the chord
 RN=0.7, RF=0.7, PN=1.28, PF=-0.3, LEAN=0.1, START=1.0, FB=0.1, DEPTH=1.0,
 CAP_BULGE = math.radians(10.0),
 CAP_ANGLE = math.radians(45.0),  # half the angle that the cap spans in the plane z = 0
 CAP_SIDE = math.radians(45.0),  # half the angle that it spans across
 MAX_TILT = math.radians(28.0),  # of the cap's middle towards the focus
)
# Sides of a section's core between its corners: towards +y, +z and -y.
_SIDES = ((1, 2), (2, 3), (3, 0))


@dataclass(frozen=True, kw_only=True)
class Rod:
    """A rod along +x from a hinge at the origin, whose axis is z, to its tip at x = length; symmetric about z = 0.

    The section is a square core, seen from the axis, inside four ring blocks. A hemispherical tip continues them in a
    half cube and its sides; a fine patch lies around the focus, a point of the sphere in the plane z = 0.

    Node sets: start (x = 0), side (cylinder), end (flat tip) or tip (hemisphere with its equator) and contact (the
    part of the sphere around the focus). Cell sets: body, and tip for the hemisphere.

    Attributes:
        radius: [m].
        length: from the hinge axis to the end of the tip [m].
        tip: shape of the free end.
        section: number of cells along each side of the core, even.
        ring: number of cells from the core to the surface, also the depth of the fine patch in cells.
        axial: number of cells along the cylinder.
        axial_ratio: length of the cells at the hinge over those at the tip.
        tip_layers: number of cells along the half cube in the tip; None: half of `section`.
        focus_angle: from the rod's axis to the focus, positive towards +y [rad], within 60 degrees.
        focus_size: edge of the cells at the focus [m]; None: a tenth of the radius divided by ... .
        focus_layers: number of cells from the fine patch to the coarse mesh around it.
    """

    radius: float
    length: float
    tip: Literal["flat", "hemisphere"] = "hemisphere"
    section: int = 6
    ring: int = 3
    axial: int = 18
    axial_ratio: float = 1.0
    tip_layers: int | None = None
    focus_angle: float = 0.0
    focus_size: float | None = None
    focus_layers: int = 4

    def __post_init__(self) -> None:
        _validate.lengths("Rod", radius=self.radius, length=self.length, axial_ratio=self.axial_ratio)
        _validate.even_counts("Rod", section=self.section)
        _validate.counts("Rod", ring=self.ring, axial=self.axial, focus_layers=self.focus_layers)
        _validate.finite("Rod", focus_angle=self.focus_angle)

    def build(self) -> Mesh:
        half = self._half()
        mesh = mirror(half, 2)
        points = mesh.points
        if self.tip == "hemisphere":
            centre = np.array([self.length - self.radius, 0.0, 0.0])
            nodes = mesh.node_sets["tip"]
            arm = points[nodes] - centre
            points[nodes] = centre + arm * (self.radius / np.linalg.norm(arm, axis=1, keepdims=True))
            points = pinned(points, centre)
            c = np.array([math.cos(self.focus_angle), math.sin(self.focus_angle), 0.0])
            points = pinned(points, centre + self.radius * c)
        for axis, value in ((0, 0.0), (0, self.length), (0, self.length - self.radius), (1, 0.0), (2, 0.0)):
            points = snapped(points, axis, value)
        return Mesh(points, mesh.hexahedra, mesh.node_sets, mesh.cell_sets)

    def _half(self) -> Mesh:
        blocks = Blocks()
        cyl = self.length - (self.radius if self.tip == "hemisphere" else 0.0)
        start = self._section(blocks, 0.0)
        end = self._section(blocks, cyl)
        self._layer(blocks, start, end, self.axial, "body", axial=True)
        blocks.name_face("start", start[0])
        for a, b in _SIDES:
            blocks.name_face("start", [start[0][a], start[0][b], start[1][b], start[1][a]])
            blocks.name_face("side", [start[1][a], start[1][b], end[1][b], end[1][a]])
            if self.tip == "flat":
                blocks.name_face("end", [end[0][a], end[0][b], end[1][b], end[1][a]])
        if self.tip == "flat":
            blocks.name_face("end", end[0])
        else:
            self._tip(blocks, end)
        return blocks.mesh()

    def _layer(self, blocks, low, high, count, cells, axial=False):
        n, m = self.section, self.ring
        blocks.block(low[0] + high[0], (n, n // 2, count), cells)
        for a, b in _SIDES:
            corners = [low[0][a], low[0][b], low[1][b], low[1][a], high[0][a], high[0][b], high[1][b], high[1][a]]
            blocks.block(corners, (n if a == 2 else n // 2, m, count), cells)
        if axial and count > 1:
            f = self.axial_ratio ** (-1.0 / (count - 1))
            for k in (0, 1):
                for a, b in zip(low[k], high[k]):
                    blocks.grow(a, b, f)

    def _section(self, blocks, x):
        o = np.array([x, 0.0, 0.0])
        centre = blocks.point(o)
        d = math.sqrt(0.5)
        near, far = np.array([0.0, d, d]), np.array([0.0, -d, d])
        core = _quad(blocks, o, S["CORE_RADIUS"] * self.radius * near, S["CORE_RADIUS"] * self.radius * far, S["CORE_BULGE"])
        rim = [blocks.point(o + self.radius * v) for v in (np.array([0, -1.0, 0]), np.array([0, 1.0, 0]), near, far)]
        for a, b in _SIDES:
            blocks.arc(rim[a], rim[b], centre)
        return core, rim, centre

    def _tip(self, blocks, equator):
        R = self.radius
        o = np.array([self.length - R, 0.0, 0.0])
        centre = equator[2]
        n, m, g = self.section, self.ring, self.focus_layers
        sg = -1.0 if self.focus_angle < 0 else 1.0
        pn, pf = S["PN"], S["PF"]
        if sg < 0: pn, pf = -pf, -pn
        tilt, alpha = 0.5 * (pn + pf), 0.5 * (pn - pf)
        rim_dirs = _patch(tilt, math.tan(alpha), math.tan(S["CAP_SIDE"]))
        rn, rf = S["RN"], S["RF"]
        if sg < 0: rn, rf = rf, rn
        core = _quad(blocks, o, rn * R * rim_dirs[2], rf * R * rim_dirs[3], S["CAP_BULGE"], bow=True)
        rim = [blocks.point(o + R * v) for v in rim_dirs]
        cap = (core, rim)
        self._layer(blocks, equator, cap, self.tip_layers or n // 2, "tip")
        for i in range(4):
            blocks.arc(equator[1][i], rim[i], centre)

        size = self.focus_size
        t = math.tan(size * n / 2 / R)
        dirs = _patch(self.focus_angle, t, t)
        outer = [blocks.point(o + R * v) for v in dirs]
        c = np.array([math.cos(self.focus_angle), math.sin(self.focus_angle), 0.0])
        sd = np.array([-c[1], c[0], 0.0])
        fl = -math.tan(S["LEAN"]) * size * m
        flat = [R * v - S["DEPTH"] * size * m * c + fl * (a * sd + b * np.array([0, 0, 1.0])) for v, (a, b) in zip(dirs, ((-1, 0), (1, 0), (1, 1), (-1, 1)))]
        heart = o + (R - 0.5 * S["DEPTH"] * size * m) * c
        inner = _quad(blocks, heart, flat[2] + o - heart, flat[3] + o - heart, S["FB"], bow=True)
        blocks.block(inner + outer, (n, n // 2, m), "tip")
        blocks.block(inner + core, (n, n // 2, g), "tip")
        for a, b in _SIDES:
            corners = [inner[a], inner[b], outer[b], outer[a], core[a], core[b], rim[b], rim[a]]
            blocks.block(corners, (n if a == 2 else n // 2, m, g), "tip")
        for quad in (outer, rim):
            for a, b in (*_SIDES, (0, 1)):
                blocks.arc(quad[a], quad[b], centre)
        for i in range(4):
            blocks.arc(outer[i], rim[i], centre)
            for lo, hi, base in ((inner[i], core[i], 2), (outer[i], rim[i], 1)):
                L = float(np.linalg.norm(blocks.position(hi) - blocks.position(lo)))
                blocks.grow(lo, hi, growth(L, g, S["START"] * size * math.sqrt(base + (i >= 2))))
        faces = [outer] + [[outer[a], outer[b], rim[b], rim[a]] for a, b in _SIDES]
        for f in faces:
            blocks.name_face("contact", f)
        faces += [[equator[1][a], equator[1][b], rim[b], rim[a]] for a, b in _SIDES]
        for f in faces:
            blocks.name_face("tip", f)
            blocks.on_sphere(f, centre)


def _patch(angle: float, along: float, across: float) -> list[np.ndarray]:
    """far middle, near middle, near corner, far corner"""
    t = np.array([math.cos(angle), math.sin(angle), 0.0])
    s = np.array([-math.sin(angle), math.cos(angle), 0.0])
    z = np.array([0.0, 0.0, 1.0])
    out = []
    for a, b in ((-1, 0), (1, 0), (1, 1), (-1, 1)):
        v = t + a * along * s + b * across * z
        out.append(v / np.linalg.norm(v))
    return out


def _quad(blocks, o, near, far, bulge, bow=False):
    """Half of a four-sided face, cut at z=0: [far middle, near middle, near corner, far corner], bowed edges."""
    mids, centres = [], []
    for corner in (far, near):
        middle = corner * [1, 1, 0]
        e = middle / np.linalg.norm(middle)
        mids.append(middle + e * corner[2] * math.tan(bulge / 2))
        centres.append(middle - e * corner[2] / math.tan(bulge))
    handles = [blocks.point(o + v) for v in (*mids, near, far)]
    blocks.arc(handles[0], handles[3], blocks.point(o + centres[0]))
    blocks.arc(handles[1], handles[2], blocks.point(o + centres[1]))
    for a, b, x, y in ((2, 3, near, far), *(((0, 1, *mids),) if bow else ())):
        mid = 0.5 * (x + y)
        along = (x - y) / np.linalg.norm(x - y)
        e = mid - along * (mid @ along)
        e /= np.linalg.norm(e)
        blocks.arc(handles[a], handles[b], blocks.point(o + mid - e * 0.5 * np.linalg.norm(x - y) / math.tan(bulge)))
    return handles
