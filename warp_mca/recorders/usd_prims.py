"""Owns what the USD recorder shows: the skin of a body as a mesh, and slave nodes in contact as points."""
# pyright: reportAttributeAccessIssue=false
# (usd-core comes without types)

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.geometry.creases import Creases
from warp_mca.recorders.colours import PALETTE, SLIP, STICK, levels

if TYPE_CHECKING:
    from warp_mca.recorders.recorder import SurfaceMesh


class _Held:
    """An attribute whose value is kept until another is written; USD interpolates between samples."""

    def __init__(self, attribute: Any) -> None:
        self.attribute = attribute
        self._last: Any = None
        self._code = 0.0

    def write(self, code: Any, value: Any) -> None:
        """Set `value` from time `code` on."""
        if self._last is not None and self._code != code.GetValue() - 1:
            self.attribute.Set(self._last, code.GetValue() - 1)  # ends the time without change
        self.attribute.Set(value, code)
        self._last, self._code = value, code.GetValue()


class BodyPrim:
    """A skin as a mesh, with normals that keep sharp edges."""

    def __init__(self, mesh: Any, name: str, surface: SurfaceMesh, points: NDArray) -> None:
        from pxr import Sdf, UsdGeom

        self.mesh = mesh
        mesh.GetPrim().SetDisplayName(name)
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        self.surface, self.seen = surface, np.zeros(0, dtype=bool)
        counts, corners = mesh.CreateFaceVertexCountsAttr(), mesh.CreateFaceVertexIndicesAttr()
        self.points, self.extent = mesh.CreatePointsAttr(), mesh.CreateExtentAttr()
        self.colour = _colours(mesh, _linear(PALETTE / 255.0))
        primvars = UsdGeom.PrimvarsAPI(mesh)
        float_array = Sdf.ValueTypeNames.FloatArray
        self.stress, plastic = (
            primvars.CreatePrimvar(name, float_array, UsdGeom.Tokens.vertex) for name in ("vonMises", "plasticStrain")
        )
        self.plastic, self.plastic_sum = _Held(plastic), -1.0
        normals = primvars.CreatePrimvar("normals", Sdf.ValueTypeNames.Normal3fArray, UsdGeom.Tokens.faceVarying)
        self.faces = [counts, corners, normals.CreateIndicesAttr()]
        self.normals = _Held(normals)
        if surface.between is None:
            for attribute, value in zip(self.faces, self._topology(surface, points), strict=True):
                attribute.Set(value)
        else:
            self.faces = [_Held(attribute) for attribute in self.faces]

    def _topology(self, surface: SurfaceMesh, points: NDArray) -> list[Any]:
        """Corners of each face, their vertices, and the group of each of them in the normals."""
        from pxr import Vt

        self.creases = Creases(surface.quads, points)
        corners = surface.quads[np.arange(4) < surface.corner_counts[:, None]]
        values = surface.corner_counts, np.ascontiguousarray(corners), self.creases.group
        return [Vt.IntArray.FromNumpy(value) for value in values]

    def write(
        self,
        code: Any,
        points: NDArray,
        von_mises: NDArray,
        plastic: NDArray,
        limit: float,
        seen: NDArray[np.bool_] | None = None,
    ) -> None:
        """Write a frame; `seen` are the faces at the surface of a body whose elements may fail."""
        from pxr import Vt

        if seen is not None and seen.any() and not np.array_equal(seen, self.seen):
            self.seen = seen.copy()
            for held, value in zip(self.faces, self._topology(self.surface.part(seen), points), strict=True):
                held.write(code, value)
        _place(self, code, points)
        self.colour.Set(Vt.IntArray.FromNumpy(levels(von_mises, limit).astype(np.int32)), code)
        self.stress.Set(Vt.FloatArray.FromNumpy(_rounded(von_mises)), code)
        # What does not change costs nothing: plastic strain only grows, and bodies hardly turn in an impact.
        if (now := float(plastic.sum(dtype=np.float64))) != self.plastic_sum:
            self.plastic.write(code, Vt.FloatArray.FromNumpy(_rounded(plastic)))
            self.plastic_sum = now
        if (normals := self.creases.normals(points)) is not None:
            self.normals.write(code, Vt.Vec3fArray.FromNumpy(normals))


class ContactPrim:
    """Slave nodes in contact as points."""

    def __init__(self, prim: Any, width: float) -> None:
        from pxr import UsdGeom

        prim.CreateWidthsAttr([width])
        prim.SetWidthsInterpolation(UsdGeom.Tokens.constant)
        self.points, self.extent = prim.CreatePointsAttr(), prim.CreateExtentAttr()
        rgb = [[(colour >> shift & 0xFF) / 255.0 for shift in (24, 16, 8)] for colour in (SLIP, STICK)]
        self.colour = _colours(prim, _linear(np.array(rgb)))

    def write(self, code: Any, points: NDArray, stick: NDArray) -> None:
        from pxr import Vt

        _place(self, code, points)
        self.colour.Set(Vt.IntArray.FromNumpy(stick.astype(np.int32)), code)


def _place(item: BodyPrim | ContactPrim, code: Any, points: NDArray) -> None:
    """Set points and their extent."""
    from pxr import UsdGeom, Vt

    places = Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(points))
    item.points.Set(places, code)
    # numpy's extremes along the longer axis take 15 times as long.
    box = UsdGeom.PointBased.ComputeExtent(places) if len(points) else Vt.Vec3fArray(2)
    item.extent.Set(box, code)


def _colours(prim: Any, palette: NDArray) -> Any:
    """Author the static palette; the attribute that takes each frame's indices into it."""
    from pxr import UsdGeom, Vt

    colour = prim.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex)
    colour.Set(Vt.Vec3fArray.FromNumpy(palette.astype(np.float32)))
    return colour.CreateIndicesAttr()


def _linear(srgb: NDArray) -> NDArray:
    """Linear colours of sRGB ones (IEC 61966-2-1), both 0 to 1."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def _rounded(value: NDArray) -> NDArray[np.float32]:
    """Values rounded to 256 of them, which USD stores in a byte or less each."""
    greatest = float(value.max(initial=0.0))
    return np.float32(greatest) * (levels(value, greatest).astype(np.float32) / np.float32(255.0)) ** 2
