"""Owns the warning about rigid bodies that turn with more inertia than their shape has, as coarse meshes give."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.geometry.cell_types import HEXAHEDRON
from warp_mca.geometry.hexahedron import CORNERS, determinants, shape_functions
from warp_mca.geometry.tetrahedron import volumes
from warp_mca.model.cells import body_materials

if TYPE_CHECKING:
    from warp_mca.geometry.mesh import Mesh
    from warp_mca.model.rigid_bodies import RigidBody
    from warp_mca.runs.prepare import Prepared
    from warp_mca.scene import Body
    from warp_mca.solve.state import State

Array = NDArray[np.float64]

EXCESS = 0.02  # of a moment of inertia, from which on a word is said: periods and times are off by half of it
TURNING = 1e-2  # energy of the rotation over that of the translation, below which inertia does not matter

_AT_GAUSS = shape_functions(CORNERS / np.sqrt(3.0))[0]  # shape (8 points, 8 corners)


def inertia_warnings(ready: Prepared, bodies: tuple[RigidBody, ...], state: State, scene: int = 0) -> list[str]:
    """One sentence for each rigid body that turns at the end with 2 % more inertia than its shape has.

    Args:
        ready: scene and meshes. bodies: rigid ones of the model, of all scenes.
        state: at the end. scene: number of the scene.
    """
    found = []
    momentum, spin = state.rigid.momentum.numpy(), state.rigid.spin.numpy()
    for k, item in enumerate(bodies):
        turning = spin[k] @ spin[k] / np.linalg.eigvalsh(item.inertia)[-1]  # twice the energy, at least
        if item.scene != scene or turning <= TURNING * (momentum[k] @ momentum[k]) / item.mass:
            continue
        excess = inertia_excess(ready.scene.body(item.name), ready.meshes[item.name])
        if excess > EXCESS:
            found.append(
                f"rigid body {item.name} turns, and a moment of inertia of its nodes is {excess:.1%} above that of its "
                "shape, since the mass of each cell lies in its corners: give it more cells"
            )
    return found


def inertia_excess(body: Body, mesh: Mesh) -> float:
    """Greatest relative excess of a moment of inertia about the mass centre, lumped masses against the volume [-].

    J = tr(S) I - S with S = integral of rho x x^T; lumping keeps mass and centre, so that S alone differs.
    """
    rho = np.empty(mesh.cell_count)
    for material, cells in body_materials(body, mesh):
        rho[cells] = material.rho
    mass, first, exact, lumped, start = 0.0, np.zeros(3), np.zeros((3, 3)), np.zeros((3, 3)), 0
    for name, conn in mesh.cells.items():
        x, density = mesh.points[conn] - mesh.points.mean(axis=0), rho[start : start + len(conn)]
        start += len(conn)
        place, weight = _points(x, name == HEXAHEDRON.name)
        weight = weight * density[:, None]
        nodal = weight @ (_AT_GAUSS if name == HEXAHEDRON.name else np.full((4, 4), 0.25))
        mass += weight.sum()
        first += np.einsum("ep,epi->i", weight, place)
        exact += np.einsum("ep,epi,epj->ij", weight, place, place)
        lumped += np.einsum("en,eni,enj->ij", nodal, x, x)
    centred = np.outer(first, first) / mass
    volume, nodes = _inertia(exact - centred), _inertia(lumped - centred)
    return float(np.linalg.eigvals(np.linalg.solve(volume, nodes)).real.max() - 1.0)


def _inertia(square: Array) -> Array:
    return np.trace(square) * np.eye(3) - square


def _points(x: Array, hexahedra: bool) -> tuple[Array, Array]:
    """Integration points [m] and weights [m^3] of cells with corners x, exact for squares in bricks and tetrahedra."""
    if hexahedra:
        return _AT_GAUSS @ x, determinants(x)
    near, far = (5.0 + 3.0 * np.sqrt(5.0)) / 20.0, (5.0 - np.sqrt(5.0)) / 20.0  # Hammer, Marlowe and Stroud 1956
    share = np.full((4, 4), far) + (near - far) * np.eye(4)
    return share @ x, np.repeat(volumes(x)[:, None] / 4.0, 4, axis=1)
