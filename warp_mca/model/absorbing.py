"""Owns the dashpots of absorbing boundaries, lumped to the nodes of a model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import bad_value
from warp_mca.model.assembly import GROUND, Assembly
from warp_mca.scene.absorbing import Absorbing

Array = NDArray[np.float64]
Index = NDArray[np.int32]

TRANSLATION = 1e-9  # spread of a body's velocities, as a share of the greatest, up to which it translates
_GAUSS = 1.0 / np.sqrt(3.0)


@dataclass(frozen=True, kw_only=True)
class AbsorbingNodes:
    """Nodes of absorbing boundaries; none where a scene has none.

    Attributes:
        node: sorted, shape (count,), int32.
        damping: matrix C of each node's dashpots [N s/m], symmetric, 0 for axes at rest, shape (count, 3, 3), float64.
        velocity: of the body that each belongs to, relative to which they absorb [m/s], shape (count, 3), float64.
    """

    node: Index
    damping: Array
    velocity: Array


def absorbing_nodes(parts: Assembly, V: Array, held: dict[str, NDArray], pairs: dict[str, NDArray]) -> AbsorbingNodes:
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
        return AbsorbingNodes(node=np.zeros(0, np.int32), damping=np.zeros((0, 3, 3)), velocity=np.zeros((0, 3)))
    seen: set[tuple[int, ...]] = set()
    damping = np.zeros((len(parts.X), 3, 3))
    for item in parts.scene.absorbing:
        _check_motion(parts, item, V)
        faces, elements = parts.meshes[item.body].surface(item.nodes)
        faces, elements = faces + parts.node_start[item.body], elements + parts.element_start[item.body]
        corners = [tuple(sorted(face)) for face in faces.tolist()]
        new = np.array([key not in seen for key in corners])  # sets may overlap
        seen.update(corners)
        np.add.at(damping, faces[new], _face_damping(parts, faces[new], elements[new]))
    free = np.stack([(held["fixed_axes"] >> k) & 1 == 0 for k in range(3)], axis=1)
    damping *= free[:, :, None] & free[:, None, :]
    node = np.flatnonzero(damping.any(axis=(1, 2)))
    node = node[~_bound(parts, node, held, pairs)].astype(np.int32)
    return AbsorbingNodes(node=node, damping=damping[node], velocity=V[node])


def _check_motion(parts: Assembly, item: Absorbing, V: Array) -> None:
    """Refuse a body that turns: no constant velocity is its own.

    Raises:
        RequestError: velocities of its nodes differ.
    """
    first = parts.node_start[item.body]
    own = V[first : first + len(parts.meshes[item.body].points)]
    if np.ptp(own, axis=0).max() > TRANSLATION * np.abs(own).max():
        what = f"{item.body} turns at the start, and sides absorb relative to one velocity; let the body translate"
        raise bad_value("Absorbing.body", item.body, what)


def _face_damping(parts: Assembly, face: Index, element: Index) -> Array:
    """Matrix C that each face gives each of its corners [N s/m], shape (face_count, 4, 3, 3).

    C_i = integral of N_i rho (c_p n n^T + c_s (I - n n^T)) dA by 2 x 2 points, which is exact for triangles and
    parallelograms; c_p and c_s are the speeds of the element behind the face.
    """
    rho = np.array([material.rho for material in parts.materials])[parts.material[element]]
    c_p = np.sqrt((parts.K[element] + 4.0 / 3.0 * parts.G[element]) / rho)
    c_s = np.sqrt(parts.G[element] / rho)
    x, total = parts.X[face], np.zeros((len(face), 4, 3, 3))
    for xi, eta in ((a, b) for a in (-_GAUSS, _GAUSS) for b in (-_GAUSS, _GAUSS)):
        left, right, low, high = 1 - xi, 1 + xi, 1 - eta, 1 + eta
        shape = 0.25 * np.array([left * low, right * low, right * high, left * high])
        along_xi = 0.25 * np.array([-low, low, high, -high])
        along_eta = 0.25 * np.array([-left, -right, right, left])
        normal = np.cross(np.einsum("k,fkc->fc", along_xi, x), np.einsum("k,fkc->fc", along_eta, x))
        area = np.linalg.norm(normal, axis=1)  # of the point; its weight is 1
        n = normal / area[:, None]
        nn = n[:, :, None] * n[:, None, :]
        matrix = (rho * area)[:, None, None] * (c_s[:, None, None] * (np.eye(3) - nn) + c_p[:, None, None] * nn)
        total += shape[:, None, None] * matrix[:, None]
    return total


def _bound(parts: Assembly, node: NDArray, held: dict[str, NDArray], pairs: dict[str, NDArray]) -> NDArray[np.bool_]:
    """Which of the nodes have their motion given in all directions: driven axes, or ties with the ground.

    Raises:
        RequestError: the motion of a node is given by drives or ties in part.
    """
    given = np.stack([(held["fixed_axes"] >> k) & 1 for k in range(3)], axis=1).astype(bool)
    given[held["prescribed_node"], held["prescribed_axis"]] = True
    touched = np.zeros(len(given), dtype=bool)
    touched[held["prescribed_node"]] = True
    grounded = pairs["joint_second"] == GROUND
    welded = grounded & (pairs["joint_tied"] == np.eye(3)).all(axis=(1, 2))
    given[pairs["joint_first"][welded]] = True
    for side in (pairs["joint_first"], pairs["joint_second"][~grounded]):
        touched[side] = True
    whole = given.all(axis=1)
    part = node[touched[node] & ~whole[node]]
    if len(part):
        starts = parts.node_start
        body = max((name for name in starts if starts[name] <= part[0]), key=lambda name: starts[name])
        sets = ", ".join(item.nodes for item in parts.scene.absorbing if item.body == body)
        what = f"a node there is driven along some axes only or tied by a joint; bind other nodes of {body}"
        raise bad_value("Absorbing.nodes", sets, what)
    return whole[node]
