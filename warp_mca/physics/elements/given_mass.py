"""Owns the nodes of a rigid body that has a mass of its own: corners of a brick carry what its mesh does not.

Nodes of the mesh keep a share of the mass, in proportion to volume, and eight loose nodes have the rest, with the place
and the inertia that this then needs. Sums over nodes so give the mass, the momentum and the energy of the body.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.geometry.inertia_brick import CARRIERS, LEAST, corner_points
from warp_mca.geometry.mesh import Mesh
from warp_mca.scene.bodies import Body

HALVINGS = 50  # of the share that the mesh keeps; flat inertias leave it next to nothing


def mesh_with_carriers(body: Body, mesh: Mesh, volumes: Array) -> Mesh:
    """The mesh of a body with a mass of its own, with the nodes that carry it behind the others.

    Args:
        body, mesh: the mesh may have these nodes already.
        volumes: that each node stands for [m^3], shape (node_count,), float64.
    """
    if CARRIERS in mesh.node_sets:
        return mesh
    rest, centre, inertia = _rest(body, mesh.points, volumes)
    points = np.concatenate([mesh.points, corner_points(rest, centre, inertia)])
    corners = np.arange(len(mesh.points), len(points), dtype=np.int32)
    return replace(mesh, points=points, node_sets={**mesh.node_sets, CARRIERS: corners})


def given_masses(body: Body, mesh: Mesh, volumes: Array) -> Array:
    """Mass of each node of a body that has one of its own [kg], shape (node_count,), float64; arguments as above."""
    assert body.mass is not None
    corners, found = mesh.node_sets[CARRIERS], np.zeros(len(mesh.points))
    if body.is_inertia:
        found[corners] = body.mass / len(corners)
        return found
    own = np.delete(np.arange(len(found)), corners)
    rest, _, _ = _rest(body, mesh.points[own], volumes[own])
    found[own] = volumes[own] * (body.mass - rest) / volumes.sum()
    found[corners] = rest / len(corners)
    return found


def _rest(body: Body, points: Array, volumes: Array) -> tuple[float, Array, Array]:
    """What nodes of the mesh do not carry: mass [kg], its centre [m] and its inertia about that [kg m^2]."""
    assert body.mass is not None
    centre, inertia = np.array(body.centre), np.array(body.inertia)
    second = 0.5 * np.trace(inertia) * np.eye(3) - inertia  # sum m r r^T about the centre
    arm = points - centre
    share = volumes / volumes.sum()
    first, moment = share @ arm, np.einsum("n,ni,nj->ij", share, arm, arm)
    halving = 0
    while True:
        halving += 1
        own = 0.5**halving
        mean = -own * first / (1.0 - own)
        rest = second / body.mass - own * moment - (1.0 - own) * np.outer(mean, mean)
        least, *_, most = np.linalg.eigvalsh(rest)
        if least > LEAST * most or halving == HALVINGS:
            rest = rest * body.mass
            return (1.0 - own) * body.mass, centre + mean, np.trace(rest) * np.eye(3) - rest
