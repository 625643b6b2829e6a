"""Owns the shape that bodies keep between two impacts: the equilibrium of their elements with the plastic strain.

The bodies are relaxed together: nodes that joints tie stay together, slaves of ties on their faces, and nodes on the
ground, on a base, on held axes or of rigid bodies stay where they are. Hinges with pins give no forces, as the bodies
of an open chain hold none against each other. Forces are those of the elements in float64, whatever the precision of
the run.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray
from scipy import sparse

from warp_mca.phases.settings import Settings
from warp_mca.physics.rigid.bodies import moves_with_rigid
from warp_mca.rigid.equilibrium import TOLERANCE, equilibrium
from warp_mca.rigid.pieces import free_motions, shared_elements
from warp_mca.rigid.stiffness import Stiffness
from warp_mca.step.solver import Solver
from warp_mca.system.bodies import GROUND
from warp_mca.system.model import Model
from warp_mca.system.state import State

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Shape:
    """Bodies in equilibrium.

    Attributes:
        u: displacements [m], shape (node_count, 3), float64.
        state: of the elements then, in float64.
        elastic, plastic, hourglass: energies then [J].
    """

    u: Array
    state: State
    elastic: float
    plastic: float
    hourglass: float

    @property
    def strain_energy(self) -> float:
        """Of the elements, plastic work included [J]."""
        return self.elastic + self.plastic + self.hourglass

    def give(self, state: State) -> None:
        """Let a state of the same model have this shape, and the history that its elements have then."""
        state.u.assign(self.u)
        for own, kept in zip(state.elements, self.state.elements, strict=True):
            own.yielded.assign(kept.yielded.numpy())
            own.history.assign(kept.history.numpy())


class Relaxation:
    """Relaxes states of one model of one scene."""

    def __init__(self, model: Model, settings: Settings, before: Relaxation | None = None) -> None:
        """Allocate a solver in float64 on the device of the `settings`; `before`: of the same bodies, turned since."""
        blocks = tuple(block.without_viscosity() for block in model.blocks)
        self.model = model = replace(model, rates=None, blocks=blocks)
        dt = model.stable.dt  # of any length: no step is taken
        self.solver = Solver(model, device=settings.device, precision="float64", dt=dt, threads=settings.threads)
        self.solver.compile()
        self.base, self.trial = self.solver.new_state(), self.solver.new_state()
        self._graphs: dict[str, Any] = {}
        second, tied = model.joint_second, np.ones(len(model.joint_first), dtype=bool)
        for item in model.couplings:
            tied[item.start : item.end] = False
        self.rigid = moves_with_rigid(model)
        self.ground = model.joint_first[(second == GROUND) & tied & ~self.rigid[model.joint_first]]
        self.tied = np.flatnonzero((second != GROUND) & ~self.rigid[model.joint_first])
        self.held = np.stack([(model.fixed_axes >> axis & 1).astype(bool) for axis in range(3)], axis=1)
        self.held[model.prescribed_node, model.prescribed_axis] = True
        self.held[self.ground] = True
        self.held[self.rigid] = True
        self.held[second[self.tied]] = True  # they follow the first node of their pair
        self.held[model.ties.slave] = True  # they follow their masters
        self.masses = model.mass.copy()
        np.add.at(self.masses, model.joint_first[self.tied], model.mass[second[self.tied]])
        self.masses[second[self.tied]] = 0.0
        self.stiffness = self._stiffness(before.stiffness if before else None)

    def settle(self, u: Array, state: State) -> Shape:
        """The equilibrium that lies nearest.

        Args:
            u: displacements to begin with [m], shape (node_count, 3), float64.
            state: of the same model, whose elements have the history to keep.

        Raises:
            GuardError: it was not found.
        """
        for own, given in zip(self.base.elements, state.elements, strict=True):
            own.yielded.assign(given.yielded.numpy())
            own.history.assign(given.history.numpy())
        u = self._joined(u)
        self._evaluate(u)
        before = self._energies()
        found = equilibrium(
            self._forces,
            u,
            self.model.X,
            self.masses,
            elastic_energy=max(before[0] + before[2], self._least(u)),
            held=self.held,
            name="the bodies",
            energy=self._energy,
            stiffness=self.stiffness,
            free=None if self.stiffness is None else self._free(u),
        )
        u = self._followed(found.u)
        self._evaluate(u)
        elastic, plastic, hourglass = self._energies()
        return Shape(u=u, state=self.trial, elastic=elastic, plastic=plastic, hourglass=hourglass)

    def _stiffness(self, before: Stiffness | None) -> Stiffness | None:
        """That of nodes that share an element, or a neighbour where pressures are of nodes. None with ties of skins."""
        model = self.model
        if len(model.ties.slave):
            return None
        found = shared_elements([block.conn for block in model.blocks], model.node_count)
        by_nodes = any(stage.nodal(slice(0, 1)) is not stage.no_nodes for stage in self.solver.elements)
        pairs = np.stack([model.joint_first[self.tied], model.joint_second[self.tied]])
        return Stiffness(self._apart, sparse.csr_array(found @ found) if by_nodes else found, pairs, before)

    def _free(self, u: Array) -> Array | None:
        """Motions without strain of the pieces, as `equilibrium` takes them."""
        model = self.model
        alone = shared_elements([block.conn for block in model.blocks], model.node_count)
        first, second = model.joint_first[self.tied], model.joint_second[self.tied]
        held = self.held.copy()
        held[second] = False
        return free_motions(model.X + u, self.masses, alone, held, np.stack([first, second]))

    def _least(self, u: Array) -> float:
        """Elastic energy of which the share TOLERANCE is no more than that of displacements rounded anyhow [J].

        Bodies that nothing has strained have less, and no search would end within a share of that.
        """
        rounding = float(np.spacing(np.abs(self.model.X + u).max()))
        omega = 2.0 / self.model.stable.dt
        return 0.5 * float(self.model.mass.sum()) * (omega * rounding) ** 2 / TOLERANCE

    def _joined(self, u: Array) -> Array:
        """Displacements with tied nodes in one place, in the middle by mass, and nodes on the ground at theirs."""
        model, found = self.model, u.copy()
        first, second = model.joint_first[self.tied], model.joint_second[self.tied]
        share = (model.mass[second] / (model.mass[first] + model.mass[second]))[:, None]
        found[first] += share * (u[second] - u[first])
        found[self.ground] = 0.0
        for body in model.rigid_bodies:
            ends = model.joint_first[body.pairs], model.joint_second[body.pairs]
            found[body.riders] = u[np.where(ends[0] == body.riders, ends[1], ends[0])]
        return self._followed(found)

    def _followed(self, u: Array) -> Array:
        """Displacements with the second node of each tied pair where the first one is, and slaves of ties on faces."""
        found = u.copy()
        found[self.model.joint_second[self.tied]] = u[self.model.joint_first[self.tied]]
        return self.model.ties.follow(found)

    def _evaluate(self, u: Array) -> None:
        """Let the trial state have displacements and what its elements make of them, from the history at the start."""
        self.trial.u.assign(u)
        self._replay(self._strain)

    def _strain(self) -> None:
        for own, kept in zip(self.trial.elements, self.base.elements, strict=True):
            wp.copy(own.yielded, kept.yielded)
            wp.copy(own.history, kept.history)
            wp.copy(own.extreme, kept.extreme)  # else what internal vectors take adds up over a search
        for stage in self.solver.elements:
            stage.launch(self.solver.work, self.trial)

    def _push(self) -> None:
        self.trial.v.zero_()
        self.solver.nodes.integrate(self.trial, 1.0, 0.0, self.solver.constraints.at_rest)

    def _replay(self, body: Callable[[], None]) -> None:
        """Launch what `body` does: from the second time on as a graph, because a search asks a thousand times."""
        with wp.ScopedDevice(self.solver.device):
            if body.__name__ in self._graphs:
                wp.capture_launch(self._graphs[body.__name__])
                return
            body()
            with wp.ScopedCapture() as capture:
                body()
            self._graphs[body.__name__] = capture.graph

    def _forces(self, u: Array) -> Array:
        """Forces of the elements on the nodes [N]; nodes that follow others give these their forces."""
        first, second = self.model.joint_first[self.tied], self.model.joint_second[self.tied]
        force = self._apart(self._followed(u))
        np.add.at(force, first, force[second])
        force[second] = 0.0
        return force

    def _apart(self, u: Array) -> Array:
        """The same where no node follows another one of a joint."""
        self._evaluate(u)
        self._replay(self._push)
        inertia = np.where(self.model.mass > 0.0, self.model.mass, 1.0)  # as `Workspace.inverse_mass` divides
        force = self.model.ties.carried(inertia[:, None] * (self.trial.v.numpy() - self.model.gravity[0]))
        force[self.rigid] = 0.0
        return force

    def _energy(self, u: Array) -> float:
        """Strain energy of displacements, plastic work included [J]."""
        self._evaluate(self._followed(u))
        return sum(self._energies())

    def _energies(self) -> tuple[float, float, float]:
        """Elastic, plastic and hourglass energy of the trial state [J], after `_evaluate`."""
        with wp.ScopedDevice(self.solver.device):
            for stage in self.solver.elements:
                stage.energies(self.solver.work, self.trial)
            elastic, plastic, hourglass = self.solver.work.energy.numpy()[[0, 1, 4]].sum(axis=1)
        return float(elastic), float(plastic), float(hourglass)
