"""Owns meshes of the geoms of a link that pictures show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warp_mca.base.errors import RequestError
from warp_mca.geometry.mesh import Mesh
from warp_mca.robots.geoms import filled, geom_surface, hull
from warp_mca.robots.machine import Machine

HIDDEN = 3  # group of geoms from which on MuJoCo's viewer does not draw them
AROUND = 24  # faces around a round geom
MOST = 4000  # triangles of a mesh; finer ones are drawn as their convex hulls


def drawn_geoms(machine: Machine, link: int) -> dict[int, Mesh]:
    """Meshes of the geoms of a link in its frame, by the number of the geom.

    Geoms are those that MuJoCo's viewer shows, of groups 0 to 2; of a link without any, all; planes never. Meshes that
    do not face away from their middle everywhere, or have more than MOST triangles, are drawn as their convex hulls.
    """
    model, plane = machine.model, int(machine.mj.mjtGeom.mjGEOM_PLANE)
    own = [
        k
        for k in range(model.ngeom)
        if machine.carrier(int(model.geom_bodyid[k])) == link and int(model.geom_type[k]) != plane
    ]
    seen = [k for k in own if int(model.geom_group[k]) < HIDDEN] or own
    return {k: mesh for k, mesh in ((k, _drawn(machine, link, k)) for k in seen) if mesh is not None}


def _drawn(machine: Machine, link: int, geom: int) -> Mesh | None:
    """The mesh of a geom in the frame of the link that carries it; None of a kind without a surface."""
    name, data = machine.names.geom(geom), machine.data
    try:
        points, faces = geom_surface(machine.mj, machine, geom, name, AROUND)
    except RequestError:
        return None
    try:
        mesh = filled(name, (points, faces) if len(faces) <= MOST else hull(points), name)
    except RequestError:
        mesh = filled(name, hull(points), name)
    turned = np.array(data.geom_xmat[geom]).reshape(3, 3)
    return replace(mesh, points=machine.local(link, np.array(data.geom_xpos[geom]) + mesh.points @ turned.T))
