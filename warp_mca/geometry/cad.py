"""Owns `Cad`: a mesh of tetrahedra in a part of a CAD file, or in the closed surface of an STL file, made by gmsh."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from warp_mca.base import validate
from warp_mca.base.arrays import Array
from warp_mca.base.errors import RequestError, bad_value
from warp_mca.base.log import warn
from warp_mca.geometry.cad_cells import mend_slivers, read_cells
from warp_mca.geometry.cad_drawing import UNITS, diagonal, draw, explained, file_stamp, reading_time
from warp_mca.geometry.cad_finer import Finer, set_finer
from warp_mca.geometry.cad_solids import chosen_solids, glued
from warp_mca.geometry.cad_volume import divided, solid_volumes
from warp_mca.geometry.cad_walls import LEAST_ACROSS, MOST_ACROSS, set_sizes
from warp_mca.geometry.gmsh_session import TOO_LONG, allow, gmsh_session
from warp_mca.geometry.mesh import Mesh
from warp_mca.geometry.quality import volumes
from warp_mca.geometry.recipe import LIMIT
from warp_mca.geometry.selection import Select, check_selections, with_selections
from warp_mca.geometry.shape_volume import of_cells

# gmsh's numbers of its algorithms for tetrahedra and for triangles, tried in turn: HXT makes the fewest slivers,
# Delaunay's meshes some solids that it cannot.
_ALGORITHMS = ((10.0, 6.0), (1.0, 6.0), (10.0, 1.0), (1.0, 5.0))
_FEWER = (0.5, 0.25)  # shares of the cells over a wall that are tried where all algorithms fail
_MESH, _ELEMENT = 60.0, 1e-4  # time that gmsh may take to mesh any part, and for an element, many times its need [s]
_FINER = 100  # times the cells of a mesh that finer places may add, for that time
_DENSE, _MANY = 8.0, 1e6  # cells in the cube of their size; so many are told of before gmsh makes them
_KEPT = 32  # meshes that stay in memory, so that a body that is placed on a plane is not meshed twice


@dataclass(frozen=True)
class Cad:
    """Ten-node tetrahedra in the solids of a STEP, IGES, BREP or STL file, of which `Body.element` "tet4" takes four.

    Edges follow the curves and faces of the file, but for those of an STL file and those that would spoil their cell
    (`quadratic.straightened`), which are straight.

    Node sets are the faces, by the name that gmsh reads in the file, or "face_1", "face_2", ..., and the selections;
    cell sets are the solids, by name or "solid_1", .... Faces of an STL file are parted by edges sharper than 40
    degrees.

    Attributes:
        path: of the file.
        size: greatest edge of a tetrahedron [m], about; small faces make smaller ones. None takes it from the walls:
            `across` tetrahedra lie over each, and they follow the curvature (`cad_walls`).
        scale: metres for one unit of the file. None takes the file's own unit where it names one (STEP, IGES), and
            metres for BREP and STL. STEP and IGES count in millimetres here whatever unit they name.
        select: more node sets.
        across: number of tetrahedra over a wall where `size` is None [-].
        solids: those of the file that make up the part, by the names that `Assembly` gives them; () for all.
        glue: distance up to which faces of two solids count as one, whose nodes they share [m]; None leaves solids
            that touch pieces of their own. Each keeps its volume as the file has it.
        notes: sentences that the mesh gets (`Mesh.notes`), of whoever looked into the file.
        finer: places with smaller cells, as where the part strikes.
    """

    path: str | Path
    size: float | None = None
    scale: float | None = None
    select: tuple[Select, ...] = ()
    across: float = 2.0
    solids: tuple[str, ...] = ()
    glue: float | None = None
    notes: tuple[str, ...] = ()
    finer: tuple[Finer, ...] = ()

    def __post_init__(self) -> None:
        validate.plain(self)
        if not isinstance(self.path, str | Path):
            raise bad_value("Cad.path", self.path, "give the path of a CAD file")
        if Path(self.path).suffix.lower() not in UNITS:
            known = ", ".join(UNITS)
            raise bad_value("Cad.path", str(self.path), f"CAD files end in {known}; MeshFile reads finished meshes")
        for name, value in (("size", self.size), ("scale", self.scale), ("glue", self.glue)):
            if value is not None:
                validate.within("Cad", 1e-12, 1e6, **{name: value})
        validate.within("Cad", LEAST_ACROSS, MOST_ACROSS, across=self.across)
        check_selections("Cad", self.select)
        validate.members("Cad", str, solids=self.solids, notes=self.notes)
        validate.members("Cad", Finer, finer=self.finer)
        if self.glue is not None and Path(self.path).suffix.lower() == ".stl":
            raise bad_value("Cad.glue", self.glue, "an STL file holds one solid; leave it out")

    def refined(self, factor: float) -> Cad:
        """The same part with tetrahedra `factor` times smaller."""
        finer = tuple(place.refined(factor) for place in self.finer)
        if self.size is None:
            return replace(self, across=self.across * factor, finer=finer)
        return replace(self, size=self.size / factor, finer=finer)

    @property
    def volume(self) -> float | None:
        """Of the solids in the file [m^3]; the part is meshed for it. None where triangles of an STL file face about.

        Raises:
            RequestError: as in `build`.
        """
        mesh = self.build()
        return float(of_cells(mesh) @ volumes(mesh)) if len(mesh.volume_ratio) else None

    def build(self) -> Mesh:
        """Meshes the part, or takes its mesh from memory if the file is as it was.

        Raises:
            RequestError: there is no such file, gmsh cannot read or mesh it, or it has no solid, or none of these
                names; solids to be glued do not touch.
        """
        stamp = file_stamp(self.path)
        plain = replace(self, path=str(Path(self.path).resolve()), select=(), notes=())
        mesh = with_selections(_meshed(plain, stamp), self.select)
        return replace(mesh, notes=(*mesh.notes, *self.notes)) if self.notes else mesh


def extent(path: str | Path, scale: float | None = None) -> Array:
    """Sides of the box around the part in a CAD file [m], shape (3,), float64; `scale` as in `Cad`.

    Raises:
        RequestError: there is no such file, gmsh cannot read it, or it has no solid.
    """
    part = Cad(path, size=1.0, scale=scale)
    if not Path(path).is_file():
        raise bad_value("Cad.path", str(path), "there is no such file; check the path")
    with gmsh_session(reading_time(path)) as gmsh, explained(str(path)):
        draw(gmsh, str(path))
        box = np.array(gmsh.model.getBoundingBox(-1, -1)).reshape(2, 3)
        return (box[1] - box[0]) * (part.scale or UNITS[Path(path).suffix.lower()])


@lru_cache(maxsize=_KEPT)
def _meshed(cad: Cad, stamp: tuple[int, int]) -> Mesh:
    """The mesh of a file that was changed last at `stamp`: time [ns] and size [byte]."""
    tries = [(cad, one) for one in _ALGORITHMS]
    if cad.size is None:
        fewer = [cad.across * share for share in _FEWER if cad.across * share >= LEAST_ACROSS]
        tries += [(replace(cad, across=across), one) for across in fewer for one in _ALGORITHMS[:2]]
    for number, (part, (solid, plane)) in enumerate(tries, start=1):
        try:
            mesh = _meshed_by(part, {"Mesh__Algorithm3D": solid, "Mesh__Algorithm": plane})
        except _MeshingError as failure:
            if number == len(tries):
                with explained(str(cad.path)):
                    raise Exception(str(failure)) from failure  # as gmsh's own errors are
        else:
            if part.across == cad.across:
                return mesh
            note = f"gmsh meshes {Path(cad.path).name} with across={part.across:g} but not with {cad.across:g}"
            return replace(mesh, notes=(*mesh.notes, note))
    raise AssertionError  # the last one has returned or raised


class _MeshingError(Exception):
    """gmsh has not meshed a solid with these algorithms; others may."""


def _meshed_by(cad: Cad, algorithms: dict[str, float]) -> Mesh:
    """The mesh that these algorithms of gmsh make.

    Raises:
        _MeshingError: they fail.
        RequestError: others would fail as well.
    """
    path = str(cad.path)
    coarse = _meshed(replace(cad, finer=()), file_stamp(path)) if cad.finer else None
    scale = cad.scale or UNITS[Path(path).suffix.lower()]
    with gmsh_session(reading_time(path), **algorithms) as gmsh, explained(path):
        notes = draw(gmsh, path)
        names = chosen_solids(gmsh.model, cad.solids) if cad.solids or cad.glue else {}
        exact = solid_volumes(gmsh, path)
        if cad.glue:
            whole = dict(zip(names.values(), exact, strict=len(exact) > 0))
            names = glued(gmsh, names, cad.glue / scale)
            exact = divided(solid_volumes(gmsh, path), list(names.values()), whole)
        try:
            if coarse is None:
                allow(gmsh, _MESH + reading_time(path) + _ELEMENT * _sized(gmsh, cad, scale, exact))
            else:
                set_finer(gmsh, cad.finer, coarse, scale)
                allow(gmsh, _MESH + reading_time(path) + _ELEMENT * _FINER * coarse.cell_count)
            gmsh.model.mesh.generate(3)
            mend_slivers(gmsh.model.mesh)
            gmsh.option.setNumber("Mesh.SecondOrderLinear", float(Path(path).suffix.lower() == ".stl"))
            gmsh.model.mesh.setOrder(2)
            if not all(len(gmsh.model.mesh.getElementTypes(*solid)) for solid in gmsh.model.getEntities(3)):
                raise Exception("it leaves a solid without tetrahedra")  # as gmsh's own errors are
        except Exception as error:
            if isinstance(error, RequestError) or TOO_LONG in str(error):
                raise
            raise _MeshingError(str(error)) from error
        mesh = read_cells(gmsh.model, scale, scale**3 * exact, names)
        return replace(mesh, notes=coarse.notes if coarse else (*mesh.notes, *notes))


def _sized(gmsh: Any, cad: Cad, scale: float, exact: Array) -> float:
    """Set the sizes of cells; the number of cells at most, of a part that fills its box.

    Args:
        exact: volumes of the solids in the file's unit, or none, see `solid_volumes`.

    Raises:
        RequestError: it is beyond all memory.
    """
    if cad.size is None:
        allow(gmsh, _MESH + reading_time(cad.path))
        size = scale * set_sizes(gmsh, cad.across, drawn=Path(cad.path).suffix.lower() != ".stl")
        if (likely := _DENSE * float(exact.sum()) * (scale / size) ** 3) > _MANY:
            name = Path(cad.path).name
            told = f"{name} gets some {1e-6 * likely:.2g} million cells, {size:.2g} m wide as its thinnest wall demands"
            warn([f"{told}: give a size or a lower across if that takes too long"])
    else:
        size = cad.size
        for name in ("Mesh.MeshSizeMax", "Mesh.MeshSizeMin"):  # without a least size gmsh divides the part in ten
            gmsh.option.setNumber(name, size / scale)
    x0, y0, z0, x1, y1, z1 = gmsh.model.getBoundingBox(-1, -1)
    count = 6.0 * (x1 - x0) * (y1 - y0) * (z1 - z0) * (scale / size) ** 3
    if count > LIMIT and cad.size is not None:
        remedy = f"up to {count:.2g} elements would result in a part of {diagonal(gmsh) * scale:.3g} m"
        raise bad_value("Cad.size", size, f"{remedy}; take a greater size, or check the scale")
    return min(count, LIMIT)
