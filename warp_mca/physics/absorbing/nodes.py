"""Owns the dashpots and springs of absorbing boundaries, lumped to the nodes of a model."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array, Index
from warp_mca.base.errors import bad_value
from warp_mca.base.rotation import rotation_matrix
from warp_mca.scene.absorbing import Absorbing
from warp_mca.system.absorbing import AbsorbingNodes
from warp_mca.system.bodies import GROUND, Bodies

TRANSLATION = 1e-9  # spread of a body's velocities, as a share of the greatest, up to which it translates
# Stiffness of the springs over G / R, across the boundary and along it (Liu, Du, Du, Wang and Wu, Earthquake Eng. Eng.
# Vib. 5 (2006) 93: 3D viscous-spring artificial boundary in time domain), as analyses commonly take it.
NORMAL, TANGENTIAL = 4.0 / 3.0, 2.0 / 3.0
_GAUSS = 1.0 / np.sqrt(3.0)


def absorbing_nodes(parts: Bodies, V: Array, held: dict[str, NDArray], pairs: dict[str, NDArray]) -> AbsorbingNodes:
    """Dashpots of the scene's absorbing boundaries; nodes whose motion is given in all directions need none.

    Args:
        parts: of the scene.
        V: initial velocities [m/s], shape (node_count, 3).
        held: axes at rest and driven axes, as `constraints.constraints` returns them.
        pairs: tied nodes, as `constraints.join_bodies` returns them.

    Raises:
        RequestError: a body does not translate, or a node is driven or tied in some directions only.
    """
    if not parts.scene.absorbing:
        none = np.zeros((0, 3, 3))
        return AbsorbingNodes(node=np.zeros(0, np.int32), damping=none, stiffness=none, velocity=none[:, 0])
    seen: set[tuple[int, ...]] = set()
    total = np.zeros((2, len(parts.X), 3, 3))  # damping, stiffness
    for item in parts.scene.absorbing:
        _check_motion(parts, item, V)
        faces, elements = parts.meshes[item.body].surface(item.nodes)
        faces, elements = faces + parts.node_start[item.body], elements + parts.element_start[item.body]
        corners = [tuple(sorted(face)) for face in faces.tolist()]
        new = np.array([key not in seen for key in corners])  # sets may overlap
        seen.update(corners)
        for matrix, of_faces in zip(total, _face_matrices(parts, item, faces[new], elements[new]), strict=True):
            np.add.at(matrix, faces[new], of_faces)
    free = np.stack([(held["fixed_axes"] >> k) & 1 == 0 for k in range(3)], axis=1)
    total *= free[:, :, None] & free[:, None, :]
    node = np.flatnonzero(total[0].any(axis=(1, 2)))
    node = node[~_bound(parts, node, held, pairs)].astype(np.int32)
    return AbsorbingNodes(node=node, damping=total[0, node], stiffness=total[1, node], velocity=V[node])


def _check_motion(parts: Bodies, item: Absorbing, V: Array) -> None:
    """Refuse a body that turns: no constant velocity is its own.

    Raises:
        RequestError: velocities of its nodes differ.
    """
    first = parts.node_start[item.body]
    own = V[first : first + len(parts.meshes[item.body].points)]
    if np.ptp(own, axis=0).max() > TRANSLATION * np.abs(own).max():
        what = f"{item.body} turns at the start, and sides absorb relative to one velocity; let the body translate"
        raise bad_value("Absorbing.body", item.body, what)


def _face_matrices(parts: Bodies, item: Absorbing, face: Index, element: Index) -> Array:
    """Damping [N s/m] and stiffness [N/m] that each face gives its corners, shape (2, face_count, 4, 3, 3).

    C_i = integral of N_i rho (c_p n n^T + c_s (I - n n^T)) dA, S_i = integral of N_i G / R (NORMAL n n^T + TANGENTIAL
    (I - n n^T)) dA, by 2 x 2 points, exact for C of triangles and parallelograms. R is the distance from the centre;
    moduli are those of the element behind the face.
    """
    centre = _centre(parts, item)
    rho = parts.rho[element]
    K, G = np.array([material.parameters[:2] for material in parts.materials])[parts.material[element]].T
    c_p, c_s = np.sqrt((K + 4.0 / 3.0 * G) / rho), np.sqrt(G / rho)
    x, found = parts.X[face], np.zeros((2, len(face), 4, 3, 3))
    for xi, eta in ((a, b) for a in (-_GAUSS, _GAUSS) for b in (-_GAUSS, _GAUSS)):
        left, right, low, high = 1 - xi, 1 + xi, 1 - eta, 1 + eta
        shape = 0.25 * np.array([left * low, right * low, right * high, left * high])
        along_xi = 0.25 * np.array([-low, low, high, -high])
        along_eta = 0.25 * np.array([-left, -right, right, left])
        normal = np.cross(np.einsum("k,fkc->fc", along_xi, x), np.einsum("k,fkc->fc", along_eta, x))
        area = np.linalg.norm(normal, axis=1)  # of the point; its weight is 1
        n = normal / area[:, None]
        nn = n[:, :, None] * n[:, None, :]
        distance = np.linalg.norm(shape @ x - centre, axis=1)
        spring = G / distance
        for k, (across, along) in enumerate(((rho * c_p, rho * c_s), (NORMAL * spring, TANGENTIAL * spring))):
            matrix = along[:, None, None] * (np.eye(3) - nn) + across[:, None, None] * nn
            found[k] += shape[:, None, None] * (area[:, None, None] * matrix)[:, None]
    return found


def _centre(parts: Bodies, item: Absorbing) -> Array:
    """Where the loads act [m], shape (3,); infinitely far away where nothing is said of it."""
    if item.centre is None:
        return np.full(3, np.inf)
    first, turn = parts.node_start[item.body], rotation_matrix(parts.scene.body(item.body).rotation)
    return parts.X[first] + turn @ (np.asarray(item.centre) - parts.meshes[item.body].points[0])


def _bound(parts: Bodies, node: NDArray, held: dict[str, NDArray], pairs: dict[str, NDArray]) -> NDArray[np.bool_]:
    """Which of the nodes have their motion given in all directions: driven axes, or ties with the ground.

    Raises:
        RequestError: the motion of a node is given by drives or ties in part.
    """
    given = np.stack([(held["fixed_axes"] >> k) & 1 for k in range(3)], axis=1).astype(bool)
    given[held["prescribed_node"], held["prescribed_axis"]] = True
    touched = np.zeros(len(given), dtype=bool)
    touched[held["prescribed_node"]] = True
    grounded: NDArray[np.bool_] = pairs["joint_second"] == GROUND
    welded = grounded & np.all(pairs["joint_tied"] == np.eye(3), axis=(1, 2))
    given[pairs["joint_first"][welded]] = True
    for side in (pairs["joint_first"], pairs["joint_second"][~grounded]):
        touched[side] = True
    whole: NDArray[np.bool_] = np.all(given, axis=1)
    part = node[touched[node] & ~whole[node]]
    if len(part):
        starts = parts.node_start
        body = max((name for name in starts if starts[name] <= part[0]), key=lambda name: starts[name])
        sets = ", ".join(item.nodes for item in parts.scene.absorbing if item.body == body)
        what = f"a node there is driven along some axes only or tied by a joint; bind other nodes of {body}"
        raise bad_value("Absorbing.nodes", sets, what)
    return whole[node]
