"""Small static problems of a mesh, with stiffnesses from the kernels that runs use."""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.linalg import spsolve
from test_elements import held_of

import warp_mca as mca
from warp_mca.geometry.degenerate import cut_to
from warp_mca.physics.elements import ELEMENTS

WAY = 1e-7  # displacement of one node by which stiffnesses are found, as a share of the mesh's extent


class Static:
    """A mesh in the cells of an element, at small strain.

    Attributes:
        mesh: so cut. cells: nodes of each cell. X: positions [m].
        stiffness: of the whole [N/m], shape (3 node_count, 3 node_count).
    """

    def __init__(self, mesh: mca.Mesh, element: str, material: mca.Elastic) -> None:
        kind = ELEMENTS[element].cell
        self.mesh = cut_to(mesh, kind)
        self.cells, self.X = self.mesh.cells[kind], self.mesh.points
        apart = np.arange(self.cells.size, dtype=np.int32).reshape(self.cells.shape)  # cells that share no node
        scattered = dataclasses.replace(
            self.mesh, points=self.X[self.cells].reshape(-1, 3), node_sets={}, cell_sets={}, others={kind: apart}
        )
        held = held_of(scattered, element, "corotational", material=material)
        n, h = 3 * self.cells.shape[1], WAY * float(np.ptp(self.X))
        own = np.empty((len(self.cells), n, n))
        for k in range(n):
            u = np.zeros((len(self.cells), n))
            u[:, k] = h
            ways = u.reshape(-1, 3)
            own[:, :, k] = (held.forces(-ways) - held.forces(ways)).reshape(-1, n) / (2.0 * h)
        rows = (3 * self.cells[:, :, None] + np.arange(3)).reshape(-1, n)
        i, j = np.repeat(rows, n, axis=1).ravel(), np.tile(rows, n).ravel()
        self.stiffness = coo_array((own.ravel(), (i, j)), shape=(self.X.size, self.X.size)).tocsr()

    def solved(self, force: np.ndarray, held: np.ndarray, at: np.ndarray | None = None) -> np.ndarray:
        """Displacements [m] under nodal forces [N], shape (node_count, 3), where some components are held: a mask of
        that shape, and their values if they are not 0."""
        u = np.where(held, 0.0 if at is None else at, 0.0).ravel()
        free = np.flatnonzero(~held.ravel())
        rest = force.ravel() - self.stiffness @ u
        u[free] = spsolve(self.stiffness[free][:, free].tocsc(), rest[free])
        return u.reshape(-1, 3)
