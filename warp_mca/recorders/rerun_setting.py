"""Owns what a rerun recording holds once: skins with their normals, rigid planes, and where contact is expected."""

from __future__ import annotations

from copy import copy
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.pictures.setting import plane_meshes, up_of
from warp_mca.recorders.rerun_blueprint import PATH_COLOURS, Sights

if TYPE_CHECKING:
    import rerun as rr

    from warp_mca.recorders.recorder import RunInfo
    from warp_mca.system.contact import ContactPass

PLANES = "/world/planes"
TO_MM = 1e3
LIGHT, DARK = 0xC9CBD1FF, 0xB3B6BFFF  # squares of a plane
EVEN = 1e-3  # slave nodes that are this share of the slave's size farther than the nearest one touch at once with it
PATCH = 0.02  # share of the slave's size around the contact over which normals are averaged


def topology(info: RunInfo, nodes: NDArray[np.int32], triangles: NDArray[np.int32]) -> rr.Mesh3D:
    """Triangles of a skin, and its normals as it stands at first contact: they hardly turn afterwards."""
    import rerun as rr

    points = info.model.X[nodes]
    a, b, c = (points[triangles[:, k]] for k in range(3))
    face = np.cross(b - a, c - a)
    normals = np.stack(
        [np.bincount(triangles.ravel(), np.repeat(face[:, k], 3), minlength=len(points)) for k in range(3)], axis=1
    )
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
    return rr.Mesh3D.from_fields(triangle_indices=triangles, vertex_normals=normals.astype(np.float32))


class PathBars:
    """Stress along a path as bars: their places, widths and colour once, their heights in every frame."""

    def __init__(self, position: NDArray[np.floating], index: int) -> None:
        """Prepare bars for path number `index` with probes at `position` [m]."""
        import rerun as rr

        place = TO_MM * np.asarray(position)
        width = np.median(np.abs(np.diff(place))) if len(place) > 1 else 1.0
        widths = np.full(len(place), width, dtype=np.float32)
        self.values: Any = rr.BarChart.from_fields(values=widths).values  # of one frame
        self.what = next(iter(rr.BarChart.columns(values=widths))).descriptor
        self.once = rr.BarChart(widths, abscissa=place, widths=widths, color=PATH_COLOURS[index % len(PATH_COLOURS)])
        object.__setattr__(self.once, "values", None)  # rerun's own setter would convert it

    def column(self, stress: NDArray[np.floating], count: int) -> rr.ComponentColumn:
        """The bars of `count` frames, `stress` [MPa] of these one after the other, shape (count probe_count,),
        float32. rerun's own conversion takes several times as long.
        """
        import pyarrow as pa
        import rerun as rr

        tensor = self.values.pa_array
        union = tensor.field("buffer")
        children = [union.field(k) for k in range(union.type.num_fields)]
        at = union.type_codes[0].as_py()
        ends = pa.array(np.linspace(0, len(stress), count + 1).astype(np.int32))
        children[at] = pa.ListArray.from_arrays(ends, pa.array(stress), type=children[at].type)
        buffers = [pa.py_buffer(np.full(count, at, np.int8)), pa.py_buffer(np.arange(count, dtype=np.int32))]
        buffer = pa.Array.from_buffers(union.type, count, [None, *buffers], children=children)
        same = [pa.concat_arrays([tensor.field(name)] * count) for name in ("shape", "names")]
        batch = copy(self.values)
        batch.pa_array = pa.StructArray.from_arrays([*same, buffer], fields=list(tensor.type))
        return rr.ComponentColumn(self.what, batch)


class Planes:
    """The rigid planes of a scene, chequered; those that move do so with the frames."""

    def __init__(self, info: RunInfo) -> None:
        points = np.concatenate([info.model.X[surface.nodes] for surface in info.surfaces.values()])
        self.meshes = plane_meshes(info.scene, points)
        self.move_at_all = any(plane.moves for plane in self.meshes)

    def log(self, stream: rr.RecordingStream) -> None:
        """Log them as they stand at t = 0, once."""
        import rerun as rr

        for k, plane in enumerate(self.meshes):
            points = plane.points[plane.quads]  # squares of their own, since colours belong to points
            first = 4 * np.arange(len(plane.quads))[:, None]
            triangles = np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])])
            colours = np.where(plane.dark, np.uint32(DARK), np.uint32(LIGHT)).repeat(4)
            mesh = rr.Mesh3D.from_fields(
                vertex_positions=points.reshape(-1, 3).astype(np.float32),
                triangle_indices=triangles.astype(np.uint32),
                vertex_normals=np.broadcast_to(plane.normal, (len(colours), 3)).astype(np.float32),
                vertex_colors=colours,
            )
            stream.log(f"{PLANES}/{k}", mesh, static=True)

    def move(self, stream: rr.RecordingStream, time: float) -> None:
        """Log where those that move are at `time` [s], the stream's present time."""
        import rerun as rr

        for k, plane in enumerate(self.meshes):
            if plane.moves:
                stream.log(f"{PLANES}/{k}", rr.Transform3D(translation=plane.shift(time)))


def sights(info: RunInfo) -> Sights:
    """Where the first views look: at the bodies that strike, and at the place where contact is expected."""
    points = np.concatenate([info.model.X[info.surfaces[body].nodes] for body in info.striking])
    bounds = np.array([points.min(axis=0), points.max(axis=0)])
    passes = [item for item in info.model.passes if item.leads]
    if not passes:
        return Sights(up_of(info.scene), bounds, None)
    distances = [_distances(info, item) for item in passes]
    first = int(np.argmin([distance.min() for distance in distances]))
    X = info.model.X[passes[first].slave]
    reach = float(np.linalg.norm(np.ptp(X, axis=0)))
    place = X[distances[first] <= distances[first].min() + EVEN * reach].mean(axis=0)
    return Sights(up_of(info.scene), bounds, np.array([place, _normal_at(place, info, passes[first])]), reach)


def _distances(info: RunInfo, item: ContactPass) -> NDArray[np.float64]:
    """From each slave node to the master [m], shape (slave_count,)."""
    from scipy.spatial import KDTree

    X = info.model.X[item.slave]
    if item.plane is None:
        return KDTree(info.model.X[item.master]).query(X)[0]
    normal = np.array(item.plane.normal) / np.linalg.norm(item.plane.normal)
    return (X - np.array(item.plane.point)) @ normal


def _normal_at(place: NDArray, info: RunInfo, item: ContactPass) -> NDArray[np.float64]:
    """Unit normal of the slave's faces around `place` [m], shape (3,)."""
    corners = info.model.X[item.slave_face]
    normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    apart = np.linalg.norm(corners.mean(axis=1) - place, axis=1)
    near = apart <= apart.min() + PATCH * float(np.ptp(corners, axis=(0, 1)).max())
    outwards = normals[near].sum(axis=0)
    return outwards / max(float(np.linalg.norm(outwards)), np.finfo(float).tiny)
