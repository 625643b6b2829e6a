"""Owns the tetrahedra in closed surfaces that do not face away from their middle everywhere."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from warp_mca.base.arrays import Array, Index
from warp_mca.base.errors import RequestError, bad_value
from warp_mca.geometry.gmsh_session import gmsh_session

TIME = 60.0  # that gmsh may take [s]
_KEPT = 32  # surfaces whose tetrahedra stay in memory, for a machine that strikes several times
_TRIANGLE, _TETRAHEDRON = 2, 4  # gmsh's numbers of cell types


def concave_cells(name: str, points: Array, faces: Index) -> tuple[Array, Index]:
    """Nodes in a closed surface [m], shape (count, 3), and tetrahedra between all nodes, those of the surface first.

    Args:
        name: of the geom, for messages.
        points: nodes of the surface [m], shape (node_count, 3), float64.
        faces: its triangles, counterclockwise from outside, shape (triangle_count, 3), int32.

    Raises:
        RequestError: the surface is open, faces inwards or crosses itself.
    """
    edges = np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)]).astype(np.int64)
    one, other = (np.sort(edges @ order) for order in ((len(points), 1), (1, len(points))))
    if (np.diff(one) == 0).any() or not np.array_equal(one, other):
        lone = len(np.setxor1d(one, other)) // 2
        remedy = f"its surface has holes or edges of more than two triangles ({lone} open edges); close it"
        raise bad_value("Robot: geom", name, remedy)
    a, b, c = (points[faces[:, k]] for k in range(3))
    if np.einsum("ij,ij->i", a - points[0], np.cross(b - points[0], c - points[0])).sum() <= 0.0:
        raise bad_value("Robot: geom", name, "its surface faces inwards; turn its triangles over")
    try:
        return _cells(np.ascontiguousarray(points).tobytes(), np.ascontiguousarray(faces, dtype=np.int32).tobytes())
    except RequestError:
        raise
    except Exception as error:
        if type(error) is not Exception:  # gmsh raises nothing more specific than this
            raise
        words = " ".join(str(error).split()).rstrip(".")
        remedy = f"gmsh cannot fill its surface ({words}), which may cross itself; repair it, or cut it into parts"
        raise bad_value("Robot: geom", name, remedy) from error


@lru_cache(maxsize=_KEPT)
def _cells(point_bytes: bytes, face_bytes: bytes) -> tuple[Array, Index]:
    """`concave_cells` of arrays as bytes.

    Raises:
        Exception: gmsh cannot make them, or changed the surface.
    """
    points = np.frombuffer(point_bytes).reshape(-1, 3)
    faces = np.frombuffer(face_bytes, dtype=np.int32).reshape(-1, 3)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    with gmsh_session(TIME, Mesh__MeshSizeMax=size, Mesh__MeshSizeExtendFromBoundary=0.0) as gmsh:
        surface = gmsh.model.addDiscreteEntity(2)
        tags = np.arange(1, len(points) + 1)
        gmsh.model.mesh.addNodes(2, surface, tags.tolist(), points.ravel().tolist())
        gmsh.model.mesh.addElementsByType(surface, _TRIANGLE, [], (faces.ravel() + 1).tolist())
        gmsh.model.geo.addVolume([gmsh.model.geo.addSurfaceLoop([surface])])
        gmsh.model.geo.synchronize()
        gmsh.model.mesh.generate(3)
        found, places, _ = gmsh.model.mesh.getNodes()
        kept = gmsh.model.mesh.getElementsByType(_TRIANGLE)[1]
        cells = np.asarray(gmsh.model.mesh.getElementsByType(_TETRAHEDRON)[1], dtype=np.int64).reshape(-1, 4)
    order = np.argsort(found)
    ordered = np.asarray(places).reshape(-1, 3)[order]
    same = len(kept) == faces.size and np.array_equal(
        *(_sorted(f) for f in (np.asarray(kept).reshape(-1, 3) - 1, faces))
    )
    if not same or not len(cells) or not np.array_equal(ordered[: len(points)], points):
        raise Exception("it changed the surface")
    return ordered[len(points) :], np.searchsorted(np.asarray(found)[order], cells).astype(np.int32)


def _sorted(faces: Index) -> Index:
    corners = np.sort(faces.astype(np.int64), axis=1)
    return corners[np.lexsort(corners.T)]
