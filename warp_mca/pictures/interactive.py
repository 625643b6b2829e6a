"""Owns interactive pictures of a recorded run, drawn by pyvista: in a window or in a notebook."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import RequestError, bad_value
from warp_mca.base.validate import brief, directions, is_number, kind_of, vectors
from warp_mca.pictures.magnify import magnified
from warp_mca.pictures.setting import VIEW, View, eye_axes, plane_mesh
from warp_mca.pictures.snapshot import FIELDS
from warp_mca.results.figure_style import engineering
from warp_mca.scene import RigidPlane
from warp_mca.scene.bodies import Vec3

BAR: dict[str, Any] = {  # beside the bodies
    **{"vertical": True, "position_x": 0.84, "position_y": 0.2, "height": 0.6},
    **{"fmt": "%.4g", "title_font_size": 13, "label_font_size": 13},
}
STEEP = 0.99  # cosine between the way up and the eye, from which on the picture's own upwards is taken

if TYPE_CHECKING:
    import pyvista  # pyright: ignore[reportMissingImports]


def plotter(
    file: str | os.PathLike[str],
    *,
    time: float | None = None,
    field: str = "von_mises",
    magnify: float = 1.0,
    view: View = VIEW,
    cut: tuple[Vec3, Vec3] | None = None,
    **options: Any,
) -> pyvista.Plotter:
    """A scene of pyvista with the bodies of a recording and the rigid planes; `.show()` opens it.

    Args:
        file: what `VtkHdfFile` or `--vtkhdf` wrote.
        time: after first contact [s]; the nearest frame is taken, the last one by default.
        field: that colours it: von_mises, plastic_strain, displacement or velocity.
        magnify: of the motion of nodes less the rigid motion of their body that is nearest to it.
        view: size, camera and hidden bodies.
        cut: a point [m] and a normal of a plane through the bodies as shown; what lies on the normal's side is left
            out.
        options: of `pyvista.Plotter`, such as off_screen=True.

    Raises:
        RequestError: pyvista is missing, the file cannot be read, or a value is not one.
    """
    if field not in FIELDS:
        raise bad_value("field", brief(field), f"choose one of {', '.join(FIELDS)}")
    if not (is_number(magnify) and magnify > 0.0):
        raise bad_value("magnify", brief(magnify), "give a factor above 0; 1 shows the shape as it is")
    kind_of("view", view, View, "give a View, as View(pixels=1600)")
    try:
        import pyvista as pv  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise RequestError(f"pyvista cannot be imported ({error}): install it with pip install pyvista") from error
    mesh, at = _read(Path(file), time)
    mesh = _without(mesh, Path(file), view)
    size: dict[str, Any] = {"window_size": (view.pixels, round(0.75 * view.pixels))} if view.pixels else {}
    found = pv.Plotter(**(size | options))
    points = _places(mesh, magnify)
    mesh.points = points
    title, colours, limit = _coloured(mesh, field)
    shown = mesh if cut is None else _section(mesh, cut)
    look: dict[str, Any] = {"cmap": colours, "clim": (0.0, limit or 1.0), "scalar_bar_args": BAR}
    look |= {"split_sharp_edges": True, "smooth_shading": True}
    found.add_mesh(shown, name="bodies", scalars=title, **look)
    up = np.asarray(mesh.field_data["up"], dtype=float).ravel()
    for k, plane in enumerate(_planes(mesh, points, up)):
        squares = pv.PolyData.from_regular_faces(plane.points + plane.shift(at), plane.quads)
        squares.cell_data["dark"] = plane.dark.astype(np.uint8)
        found.add_mesh(squares, name=f"plane {k}", scalars="dark", cmap=["#e0e0e6", "#c7c9d1"], show_scalar_bar=False)
    found.add_text(f"{1e6 * at:.1f} µs after first contact", font_size=10)
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    _, upwards, eye = eye_axes(up, np.ptp(points, axis=0), view.camera)
    found.camera_position = [centre + eye, centre, upwards if abs(up @ eye) > STEEP else up]
    bounds = np.stack([points.min(axis=0), points.max(axis=0)], axis=1).ravel().tolist()
    found.reset_camera(bounds=bounds)  # pyright: ignore[reportCallIssue]  (a decorator hides its first argument)
    return found


def _coloured(mesh: pyvista.DataSet, field: str) -> tuple[str, Any, float]:
    """Name of the values that colour the mesh, its colours and the value at their upper end, as pictures have them."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    kind, value = FIELDS[field], np.asarray(mesh.point_data[field])
    value = np.linalg.norm(value, axis=1) if value.ndim == 2 else value
    limit = float(np.quantile(value, 1.0 - kind.beyond)) if len(value) else 0.0
    scale, unit = engineering(limit, kind.unit) if kind.unit else (1.0, "")
    title = f"{kind.words} [{unit or '-'}]"
    mesh.point_data[title] = scale * value
    return title, ListedColormap(colormaps["viridis"](np.linspace(0.0, 1.0, 256) ** kind.power)), scale * limit


def _section(mesh: pyvista.DataSet, cut: tuple[Vec3, Vec3]) -> pyvista.DataSet:
    """The mesh behind a plane, with values on the section.

    Raises:
        RequestError: it is no plane, or nothing is behind it.
    """
    if not (isinstance(cut, tuple | list) and len(cut) == 2):
        raise bad_value("cut", brief(cut), "give a point and a normal, as ((0, 0, 0), (0, 1, 0))")
    point, normal = cut
    vectors("plotter", cut=point)
    directions("plotter", cut=normal)
    kept = mesh.clip(normal=normal, origin=point)  # pyright: ignore[reportCallIssue]
    if not kept.n_cells:
        raise bad_value("cut", cut, "nothing is left to show; turn the normal, or move the point into the bodies")
    return kept


def _without(mesh: pyvista.DataSet, path: Path, view: View) -> pyvista.DataSet:
    """The mesh less the bodies that the view hides.

    Raises:
        RequestError: the recording has no such body, or no other.
    """
    if not view.hidden:
        return mesh
    import h5py

    with h5py.File(path, locking=False) as file:  # a run may be writing it
        stored: Any = file["VTKHDF/CellData/body"].attrs["names"]
        names = [str(name) for name in stored]
    view.check(names)
    hidden = [names.index(name) for name in view.hidden]
    kept = mesh.extract_cells(~np.isin(mesh.cell_data["body"], hidden))
    for name in mesh.field_data:
        kept.field_data[name] = mesh.field_data[name]
    return kept


def _read(path: Path, time: float | None) -> tuple[pyvista.DataSet, float]:
    """The mesh with its fields at the frame nearest to `time`, and that frame's time [s].

    Raises:
        RequestError: the file cannot be read, or the time is not one.
    """
    import pyvista as pv  # pyright: ignore[reportMissingImports]
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
    from vtkmodules.vtkIOHDF import vtkHDFReader

    if time is not None and not is_number(time):
        raise bad_value("time", brief(time), "give a finite time [s]")
    reader = vtkHDFReader()
    if not (path.is_file() and reader.CanReadFile(str(path))):
        raise bad_value("file", str(path), "give a recording that VtkHdfFile or --vtkhdf wrote")
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    times = np.array(reader.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS()) or _times(path))
    step = len(times) - 1 if time is None else int(np.argmin(np.abs(times - time)))
    reader.SetStep(step)
    reader.Update()
    mesh = pv.wrap(reader.GetOutputDataObject(0))
    if "up" not in mesh.field_data:
        raise bad_value("file", str(path), "it does not say which way is up; record it again with this version")
    return mesh, float(times[step])


def _times(path: Path) -> list[float]:
    """Times of the frames [s], which the reader does not tell of a single one."""
    import h5py

    with h5py.File(path, locking=False) as file:
        stored: Any = file["VTKHDF/Steps/Values"]
        return [float(time) for time in stored]


def _places(mesh: pyvista.DataSet, magnify: float) -> NDArray[np.float64]:
    """Points of the deformed mesh [m], shape (point_count, 3)."""
    places = np.array(mesh.points, dtype=float)
    displacement = np.asarray(mesh.point_data["displacement"], dtype=float)
    for body in np.unique(mesh.cell_data["body"]):
        nodes = np.asarray(mesh.extract_cells(mesh.cell_data["body"] == body).point_data["vtkOriginalPointIds"])
        places[nodes] = magnified(places[nodes], displacement[nodes], magnify)
    return places


def _planes(mesh: pyvista.DataSet, points: NDArray[np.float64], up: NDArray[np.float64]) -> list[Any]:
    """Meshes of the rigid planes that the recording names, around `points` [m]."""
    if "plane_point" not in mesh.field_data:
        return []
    columns = (np.asarray(mesh.field_data[f"plane_{name}"]).reshape(-1, 3) for name in ("point", "normal", "velocity"))
    return [
        plane_mesh(RigidPlane(point=(*p,), normal=(*n,), velocity=(*v,)), points, up)
        for p, n, v in zip(*(column.tolist() for column in columns), strict=True)
    ]
