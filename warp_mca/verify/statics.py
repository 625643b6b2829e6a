"""Owns statics of one body by the engine's own element kernels: stiffness, equilibrium, slow loading beyond yield.

Elements are judged apart from time integration here. Nodes are displaced, the force kernels give the forces of each
element, and scipy solves the system.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

import warp_mca as mca
from warp_mca.base.errors import GuardError
from warp_mca.geometry.mesh import Mesh
from warp_mca.verify.case import Setup

if TYPE_CHECKING:
    from scipy.sparse import csc_matrix

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Mask = NDArray[np.bool_]
Kinematics = Literal["corotational", "finite"]

SMALL = 1e-5  # displacements that count as small, as a share of the shortest edge [-]
ENOUGH = 300  # evaluations of forces after which a state that should settle has not


class Imposed:
    """A body at rest whose nodes are displaced at will.

    Attributes:
        X: positions of the nodes before [m], shape (node_count, 3), float64.
        mesh: of the body, with the cells that its element computes.
        slot_node: node of each entry of what `slots` gives, shape (slot_count,), int64.
    """

    def __init__(self, setup: Setup, geometry: Mesh, material: mca.Elastic, kinematics: Kinematics = "corotational"):
        from warp_mca.model.build import build_model
        from warp_mca.physics.elements.cells import nodal_masses
        from warp_mca.rigid.handoff import hand_off
        from warp_mca.step.output import NodalStress
        from warp_mca.step.solver import Solver

        body = mca.Body(name="block", geometry=geometry, material=material, kinematics=kinematics)
        scene = mca.Scene(name="imposed", bodies=(body,), impact=mca.ImpactPhase(duration=1.0))
        scene = setup.with_element(scene)
        meshes = mca.mesh(scene)
        start = hand_off(scene, meshes, nodal_masses(scene, meshes))
        self.mesh = meshes["block"]
        self.model = build_model(scene, meshes, start.positions, start.velocities)
        self.solver = Solver(self.model, device=setup.device, precision=setup.precision, dt=self.model.stable.dt)
        self.solver.compile()
        self.state = self.solver.new_state()
        self.nodal_stress = NodalStress(self.solver, np.arange(self.model.node_count, dtype=np.int32))
        self.X = self.model.X
        self.slot_node: Index = np.concatenate([stage.slot_node for stage in self.solver.elements]).astype(np.int64)

    def force(self, u: Array) -> Array:
        """Forces of the elements on the nodes [N], shape (node_count, 3), float64, read off the momentum of one step.

        Args:
            u: displacements [m], shape (node_count, 3), float64.
        """
        self.state.u.assign(u)
        self.state.v.zero_()
        self.solver.step(self.state, 1)
        return self.model.mass[:, None] * self.state.v.numpy() / self.solver.dt

    def largest_element_force(self) -> float:
        """Greatest force of one element on one node [N] in the step that `force` made."""
        return float(np.linalg.norm(self.solver.work.force.numpy(), axis=1).max())

    def stress(self, u: Array) -> Array:
        """xx, yy, zz, xy, yz, xz at the nodes [Pa], shape (node_count, 6), float64."""
        self.state.u.assign(u)
        self.nodal_stress.launch(self.state)
        return self.nodal_stress.tensor.numpy().astype(np.float64)

    def slots(self, u: Array) -> Array:
        """Forces of each element on each of its nodes [N], shape (slot_count, 3), float64; what yields flows."""
        self.state.u.assign(u)
        self.solver.forces(self.state)
        return self.solver.work.force.numpy()[: len(self.slot_node)].astype(np.float64)

    def settled(self, u: Array) -> Array:
        """As `slots`, once internal modes of elements, which lag one step, no longer change."""
        now = self.slots(u)
        for _ in range(ENOUGH):
            before, now = now, self.slots(u)
            if np.abs(now - before).max() <= 1e-13 * np.abs(now).max():
                break
        return now

    def nodal(self, slots: Array) -> Array:
        """Sums of forces of elements at the nodes [N], shape (node_count, 3), float64."""
        sums = [np.bincount(self.slot_node, column, minlength=self.model.node_count) for column in slots.T]
        return np.stack(sums, axis=1).astype(np.float64)

    @property
    def shortest(self) -> float:
        """Shortest distance between two nodes of an element [m]."""
        found = np.inf
        for stage in self.solver.elements:
            x = self.X[stage.block.conn]
            for a in range(len(x) - 1):
                length = np.linalg.norm(x[a + 1 :] - x[a], axis=2)
                found = min(found, float(length[length > 0.0].min(initial=np.inf)))
        return found


def dependence(body: Imposed) -> tuple[csc_matrix, Index]:
    """Which nodes forces of elements depend on, shape (element_count, node_count), and the element of each slot.

    Where a formulation averages over neighbours these are the nodes of the neighbours, too.
    """
    from scipy.sparse import csc_matrix, vstack

    from warp_mca.physics.elements import ELEMENTS

    parts, owner, first = [], [], 0
    for stage in body.solver.elements:
        element = np.tile(np.arange(stage.count), stage.corners)
        shape = (stage.count, body.model.node_count)
        part = csc_matrix((np.ones(len(element)), (element, stage.slot_node)), shape=shape)
        if getattr(ELEMENTS[stage.block.element], "one_rate", False):
            part = part @ part.T @ part
        parts.append(part)
        owner.append(first + element)
        first += stage.count
    return csc_matrix(vstack(parts)), np.concatenate(owner)


def colours(depends: csc_matrix) -> Index:
    """A colour for each node such that no element depends on two nodes of one colour, shape (node_count,), int64."""
    near = (depends.T @ depends).tocsr()
    colour = np.full(near.shape[0], -1, dtype=np.int64)
    for node in range(len(colour)):
        taken = set(colour[near.indices[near.indptr[node] : near.indptr[node + 1]]].tolist())
        colour[node] = next(c for c in range(len(taken) + 1) if c not in taken)
    return colour


def stiffness(body: Imposed) -> csc_matrix:
    """Stiffness of a body in its first state [N/m], shape (3 node_count, 3 node_count), by central differences.

    Nodes of one colour are displaced together, since each element's forces answer to one of them.

    Args:
        body: on the CPU, in float64.
    """
    from scipy.sparse import csc_matrix

    depends, owner = dependence(body)
    by_element, colour = depends.tocsr(), colours(depends)
    count = sum(stage.count for stage in body.solver.elements)
    element, node = np.repeat(np.arange(count), np.diff(by_element.indptr)), by_element.indices
    h, size = 0.1 * SMALL * body.shortest, 3 * body.model.node_count
    rows, columns, values = [], [], []
    for chosen in (colour == c for c in range(colour.max() + 1)):
        cause = np.full(count, -1, dtype=np.int64)  # the displaced node that each element depends on
        cause[element[chosen[node]]] = node[chosen[node]]
        slot = np.flatnonzero(cause[owner] >= 0)
        for axis in range(3):
            u = np.zeros((body.model.node_count, 3))
            u[chosen, axis] = h
            slope = (body.settled(-u) - body.settled(u))[slot] / (2.0 * h)
            rows.append((3 * body.slot_node[slot][:, None] + np.arange(3)).ravel())
            columns.append(np.repeat(3 * cause[owner[slot]] + axis, 3))
            values.append(slope.ravel())
    where = (np.concatenate(rows), np.concatenate(columns))
    return csc_matrix((np.concatenate(values), where), shape=(size, size))


class Statics:
    """Equilibrium of a body, of which components of the displacement are held or given.

    The stiffness is measured on the CPU in float64: one measured in float32 is too coarse for slender bodies.
    Displacements are then corrected until the forces, on the device and in the precision asked for, balance the load.

    Attributes:
        body: on the device and in the precision asked for.
        K: stiffness [N/m], shape (3 node_count, 3 node_count).
        frames: axes of the components of all vectors at each node [-], the columns of matrices, shape (node_count, 3,
            3), float64; None for x, y, z.
    """

    def __init__(
        self,
        setup: Setup,
        geometry: Mesh,
        material: mca.Elastic,
        axes: Callable[[Array], Array] | None = None,
        kinematics: Kinematics = "corotational",
    ):
        """Measure the stiffness; `axes` gives `frames` of the nodes' positions."""
        from scipy.sparse import block_diag

        self.body = Imposed(setup, geometry, material, kinematics)
        self.frames = axes(self.body.X) if axes else None
        self._factored: tuple[Index, Callable[[Array], Array]] | None = None
        double = replace(setup, device="cpu", precision="float64")
        self.K = stiffness(self.body if setup == double else Imposed(double, geometry, material, kinematics))
        if self.frames is not None:
            turn = block_diag(self.frames)
            self.K = (turn.T @ self.K @ turn).tocsc()

    def _forces(self, u: Array) -> Array:
        """Forces of the elements on the nodes [N]; they and u are by components in `frames`."""
        if self.frames is None:
            return self.body.nodal(self.body.slots(u))
        forces = self.body.nodal(self.body.slots(np.einsum("nij,nj->ni", self.frames, u)))
        return np.einsum("nji,nj->ni", self.frames, forces)

    def _correction(self, held: Mask, left: Array) -> Array:
        """Displacements [m] by which the stiffness balances forces [N] at the components that are free."""
        from scipy.sparse.linalg import splu

        free = np.flatnonzero(~held.ravel())
        if self._factored is None or not np.array_equal(self._factored[0], free):
            self._factored = (free, splu(self.K[free][:, free].tocsc()).solve)
        found = np.zeros(held.size)
        if len(free):
            found[free] = self._factored[1](left.ravel()[free])
        return found.reshape(-1, 3)

    def solve(self, load: Array, held: Mask, given: Array | None = None) -> Array:
        """Small displacements [m], shape (node_count, 3), under forces on nodes [N].

        Args:
            load: forces [N], shape (node_count, 3).
            held: whether a component is held, shape (node_count, 3).
            given: displacements of those that are held [m], shape (node_count, 3); 0 by default.
        """
        u = np.zeros(held.shape) if given is None else np.where(held, given, 0.0)
        u = u + self._correction(held, load - (self.K @ u.ravel()).reshape(-1, 3))
        scale = SMALL * self.body.shortest / np.abs(u).max()
        for _ in range(3):
            u = u + self._correction(held, load + self._forces(scale * u) / scale)
        return u

    def drive(self, held: Mask, given: Array, increments: int = 400, tolerance: float = 1e-4) -> Array:
        """Forces that hold a body at the end of a slow motion [N], shape (node_count, 3), float64.

        In each increment the elastic stiffness brings the forces to balance. Since it is never softer than the body,
        no correction goes too far, and what flows does not flow back. Increments are many because internal modes of
        elements lag by one evaluation: with twenty, upsetting would take 2 % less pressure.

        Args:
            held: whether a component is held, shape (node_count, 3).
            given: displacements of those that are held at the end [m], shape (node_count, 3).
            increments: in which the displacements grow.
            tolerance: forces that may be left, and may change when nothing moves, as a share of the largest [-].

        Raises:
            GuardError: an increment finds no balance.
        """
        u = before = f = np.zeros(held.shape)
        for k in range(1, increments + 1):
            # go on as in the increment before
            u, before = 2.0 * u - before, u
            u = np.where(held, k / increments * given, u)
            if k == 1:
                u = u + self._correction(held, -(self.K @ u.ravel()).reshape(-1, 3))
            f, balanced = self._forces(u), False
            for _ in range(ENOUGH):
                last, left = f, np.where(held, 0.0, f)
                bound = tolerance * np.abs(f).max()
                if balanced := bool(np.abs(left).max() < bound):
                    f = self._forces(u)
                    if np.abs(f - last).max() < bound:
                        break
                else:
                    u = u + self._correction(held, left)
                    f = self._forces(u)
            if not balanced:
                raise GuardError(f"increment {k} of {increments} finds no balance of forces")
        return -f


def area_shares(mesh: Mesh, on: Mask) -> Array:
    """Shares of nodes in the area of the boundary faces on some of them [m^2], shape (node_count,), float64."""
    faces, _ = mesh.boundary
    faces = faces[on[faces].all(axis=1)]
    x, triangle = mesh.points[faces], faces[:, 2] == faces[:, 3]
    area = 0.5 * np.linalg.norm(np.cross(x[:, 2] - x[:, 0], x[:, 3] - x[:, 1]), axis=1)
    share = np.where(triangle, area / 3.0, area / 4.0)[:, None] * np.ones(4)
    share[triangle, 3] = 0.0
    return np.bincount(faces.ravel(), share.ravel(), minlength=len(mesh.points)).astype(np.float64)
