"""Owns velocities at half steps of bodies that settle, and how a state gets others.

Velocities are held at half steps: v(n) is the mean of v(n-1/2) and v(n+1/2), and one step of a copy of the state tells
how far they are apart. The frequency of a motion is that of Rayleigh's quotient over its way d, with the change of
acceleration a meanwhile (Underwood, Dynamic relaxation, in Computational Methods for Transient Analysis, 1983):

    w^2 = -d . M a / d . M d.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.base.errors import GuardError
from warp_mca.kernels.materials import prony, prony_bulk
from warp_mca.physics.contact.edge_stage import EdgeStage
from warp_mca.scene import DampedPenalty

if TYPE_CHECKING:
    from warp_mca.phases.impact import Impact
    from warp_mca.phases.scene_run import SceneRun
    from warp_mca.step.solver import Solver
    from warp_mca.system.state import State

Array = NDArray[np.float64]
ALL_AXES = 7  # at rest, in the role of a node
AT_ONCE = 1e-6  # time in which materials relax, in steps
HEAVY = 1e60  # mass [kg] and inertia [kg m^2] of rigid bodies that nothing moves


class Exchanged:
    """Arrays that have other values until they are released."""

    def __init__(self) -> None:
        """None yet."""
        self.before: list[tuple[wp.array, NDArray]] = []

    def _put(self, array: wp.array, values: NDArray) -> None:
        self.before.append((array, array.numpy().copy()))
        array.assign(values)

    def release(self) -> None:
        """Give them their own values."""
        for array, values in self.before:
            array.assign(values)


class Held(Exchanged):
    """Bodies that nothing accelerates until they are released: other bodies settle on what hangs from them, too."""

    def __init__(self, solver: Solver, nodes: NDArray[np.bool_], bodies: NDArray[np.bool_]) -> None:
        """Hold nodes of flexible bodies, and rigid bodies."""
        super().__init__()
        role = solver.constraints.role
        if nodes.any() and len(role):
            self._put(role, np.where(nodes, role.numpy() | ALL_AXES, role.numpy()))
        if bodies.any():
            own, held = solver.rigid.bodies, bodies[:, None, None]
            self._put(own.mass, np.where(bodies, HEAVY, own.mass.numpy()))
            self._put(own.inertia, np.where(held, HEAVY * np.eye(3), own.inertia.numpy()))
            self._put(own.inverse_inertia, np.where(held, np.eye(3) / HEAVY, own.inverse_inertia.numpy()))
            self._put(own.gravity, np.where(bodies[:, None], 0.0, own.gravity.numpy()))


class Relaxed(Exchanged):
    """Viscoelastic materials that relax at once until they are released: what rests has the moduli of a long time."""

    def __init__(self, solver: Solver, dt: float) -> None:
        """Give the terms of each `Prony` series a time of 1e-6 of a step of dt [s]."""
        super().__init__()
        law = np.array(solver.work.law.numpy())
        for block in solver.model.blocks:
            module, *given = block.law.split(":")
            if module in (prony.__name__, prony_bulk.__name__):
                first = prony.FIRST + int(given[0])
                law[np.unique(block.material), first : first + int(given[0])] = AT_ONCE * dt
        if (law != solver.work.law.numpy()).any():
            self._put(solver.work.law, law)


class HalfSteps:
    """Velocities of nodes and momenta of rigid bodies at half steps, and how a state gets others.

    A phase calls `slow(0.0)` at its start, `look` and `slow` after some steps, `rest` at its end, and `release` after
    `stretch_ended`.
    """

    def __init__(self, impact: Impact, falling: bool = False) -> None:
        """Bodies that have a velocity now, at the start, wait from now on; with `falling` until `fall` is called."""
        self.impact, self.solver, self.state = impact, impact.solver, impact.state
        model = self.solver.model
        self.kept = impact.scene_runs[0].ledger.kept
        self.trial = self.state.copy()
        waiting = np.zeros(model.node_count, dtype=bool)
        ends = [*sorted(model.node_start.values())[1:], model.node_count]
        for first, end in zip(sorted(model.node_start.values()), ends, strict=True):
            waiting[first:end] = model.V[first:end].any()
        bodies = np.array([waiting[body.own[0]] for body in model.rigid_bodies], dtype=bool)
        self.waiting = self.moving = [waiting, bodies, bodies]
        self.falling, self.clock = falling, self.state.steps
        self.rise = self._settle(True)
        self.quarter, self.since = 0.0, 0
        self.seen: list[Array] = []
        self.now = before, after = self._half_steps()
        self.initial = [0.5 * (a + b) for a, b in zip(before, after, strict=True)]
        rigid = self.state.rigid
        self.places = [(self.state.u, waiting), (rigid.centre, bodies), (rigid.rotation, bodies)]
        self.start = [np.array(array.numpy()) for array, _ in self.places]
        # dashpots of contacts wait: changes of velocity between steps would be lost from what they book
        damped = [item for item in self.solver.contacts if item.laws.normal == DampedPenalty.law]
        self.dashpots = [(item.parameters, np.array(item.parameters.numpy())) for item in damped]
        for parameters, _ in self.dashpots:
            parameters.zero_()
        self.relaxed = Relaxed(self.solver, impact.steps.dt)
        self.held = Held(self.solver, waiting & (not falling), bodies & (not falling))
        self.now = self._half_steps()

    def fall(self) -> None:
        """Let bodies settle that fall, which have lost their velocity by now; it is theirs again in `release`."""
        if self.falling:
            self.waiting, self.places = [np.zeros_like(mask) for mask in self.moving], []

    def _settle(self, on: bool) -> float:
        """Tell loads that bodies settle, or no more; the time that bolts take to be tightened [s]."""
        return max((getattr(self.solver, kind).settle(on) for kind in self.solver.model.loads), default=0.0)

    def look(self) -> float:
        """Kinetic energy of the bodies that settle, the mean of those half a step before and after [J].

        That of records, v(n-1/2) . M v(n+1/2) / 2, is below 0 where bodies turn back. `quarter` [s] becomes that of
        the period of what moves.

        Raises:
            GuardError: a guard has stopped the phase.
        """
        if self.impact.stopped[0] is not None:
            raise GuardError(f"before the impact: {self.impact.stopped[0]}")
        self.now = self._half_steps()
        (before, *_), (after, *_) = self.now
        settling = ~self.waiting[0]
        gained = self._fallen()[0]
        self.quarter = self._quarter((after - before) / self.impact.steps.dt, gained)
        return 0.5 * sum(self._kinetic(v - gained, v - gained, settling) for v in (before, after))

    def _quarter(self, acceleration: Array, gained: Array) -> float:
        """Of the period by Rayleigh's quotient [s]; 0 without motion, infinite without stiffness.

        It is renewed once for each such quarter, over which slow motions go farther than what still rings.
        """
        steps = self.state.steps - self.since
        if self.seen and steps < self.quarter / self.impact.steps.dt:
            return self.quarter
        seen, self.seen = self.seen, [np.array(self.state.u.numpy(), dtype=np.float64), acceleration]
        self.since = self.state.steps
        if not seen:
            return 0.0
        way, change = (now - last for now, last in zip(self.seen, seen, strict=True))
        way = way - 0.5 * steps * self.impact.steps.dt * gained
        weight = np.where(self.waiting[0], 0.0, self.solver.model.mass)
        stiffness, inertia = -weight @ (way * change).sum(axis=1), weight @ (way * way).sum(axis=1)
        return 0.5 * math.pi * math.sqrt(inertia / stiffness) if stiffness > 0.0 else math.inf if inertia else 0.0

    def slow(self, factor: float) -> None:
        """Let bodies that wait be where they were without velocity, and the others keep a factor of theirs."""
        wanted, fallen = [], self._fallen()
        for before, after, waiting, gained in zip(*self.now, self.waiting, fallen, strict=True):
            wanted.append(np.where(waiting[:, None], 0.0, factor * (0.5 * (before + after) - gained)))
        self.clock = self.state.steps
        self._give(wanted, factor != 1.0 or any(gained.any() for gained in fallen))
        for (array, mask), start in zip(self.places, self.start, strict=False):
            if mask.any():
                array.assign(np.where(mask[:, None], start, array.numpy()))

    def _fallen(self) -> list[Array]:
        """What gravity has given to velocities and momenta since they were slowed, where bodies settle without weight.

        In all this time it moves them by nanometres, all alike.
        """
        model, time = self.solver.model, (self.state.steps - self.clock) * self.impact.steps.dt
        found = [np.zeros_like(array) for array in self.now[0]]
        if self.falling:
            role = self.solver.constraints.role
            held = (role.numpy()[:, None] >> np.arange(3)) & 1 if len(role) else 0
            found[0][:] = np.where(held, 0.0, time * model.gravity[0])
            if len(found[1]):
                found[1][:] = time * np.outer(self.solver.rigid.bodies.mass.numpy(), model.gravity[0])
        return found

    def rest(self, steps: int) -> None:
        """So many steps in which contact forces are summed, as before any row: the first one of the impact has them."""
        for contact in self.state.contacts:
            for array in (contact.spring.impulse, contact.spring.normal_impulse, contact.spring.stick_impulse):
                array.zero_()
        self.solver.search(self.state)
        self.solver.step(self.state, steps)
        self.look()
        self.slow(0.0)

    def release(self, scene_run: SceneRun) -> None:
        """Let bodies that waited have their velocities, in a state whose rows begin anew."""
        for parameters, values in self.dashpots:
            parameters.assign(values)
        self.held.release()
        self.relaxed.release()
        self._settle(False)
        self.waiting = self.moving
        kept, state = scene_run.ledger.kept, self.state
        self.look()
        (before, *_), (after, *_) = self.now
        at_rest = self._kinetic(before, after, ~self.waiting[0])
        self._give(self.initial, False)
        v = np.array(state.v.numpy(), dtype=np.float64)
        given = self._kinetic(v, 2.0 * self.initial[0] - v, self.waiting[0])
        kept.initial_energy += given
        kept.initial_kinetic = at_rest + given
        state.normal_force.zero_()
        squares = (self.solver.model.V**2).sum(axis=1)
        state.speed_square.assign(squares if len(state.speed_square) > 1 else squares.max(keepdims=True))

    def _half_steps(self) -> tuple[list[Array], list[Array]]:
        """Velocities and momenta half a step before and after the present time."""
        self.trial.assign(self.state)
        before = [np.array(array.numpy(), dtype=np.float64) for array in self._arrays(self.state)]
        with wp.ScopedDevice(self.solver.device):
            self.solver.step(self.trial, 1)
        return before, [np.array(array.numpy(), dtype=np.float64) for array in self._arrays(self.trial)]

    def _give(self, wanted: list[Array], everything: bool) -> None:
        """Give velocities at the present time to bodies that wait, or to all, and book what the others lose."""
        before, after = self.now
        half = [0.5 * (b - a) for a, b in zip(before, after, strict=True)]
        masks = [np.ones_like(mask) if everything else mask for mask in self.waiting]
        given = [
            np.where(mask[:, None], value - kick, old)
            for mask, value, kick, old in zip(masks, wanted, half, before, strict=True)
        ]
        for array, values in zip(self._arrays(self.state), given, strict=True):
            if len(array):
                array.assign(values)
        changed = masks[0] & ~self.waiting[0]
        lost = self._kinetic(before[0], after[0], changed)
        self.kept.damping += lost - self._kinetic(given[0], given[0] + 2.0 * half[0], changed)
        way = self.impact.steps.dt * (before[0] - given[0])
        self.kept.damping += self._unfelt(way)
        for kind in self.solver.model.loads if self.state.steps else ():  # no step has moved anything before
            getattr(self.solver, kind).feel(self.state, self.trial, way)

    def _unfelt(self, way: Array) -> float:
        """Work of friction over the way that a change of velocity hides from springs along surfaces [J].

        They add up velocities times steps, and nodes moved by those before the change. `way`: [m], (node_count, 3).
        """
        work = 0.0
        for stage, own in zip(self.solver.contacts, self.state.contacts, strict=True):
            tangential = np.array(own.spring.tangential.numpy(), dtype=np.float64)
            if not len(tangential) or isinstance(stage, EdgeStage):
                continue
            face = np.array(own.spring.face.numpy(), dtype=np.int32)
            pressed = np.flatnonzero(face >= 0)
            moved = way[np.array(stage.slave.numpy(), dtype=np.int32)[pressed // stage.sides]]
            if not stage.on_plane:
                corners = np.array(stage.face.numpy(), dtype=np.int32)[face[pressed]]
                weight = np.array(own.spring.weight.numpy(), dtype=np.float64)
                moved = moved - np.einsum("sk,ski->si", weight[pressed], way[corners])
            work -= float((tangential[pressed] * moved).sum())
        return work

    def _kinetic(self, before: Array, after: Array, mask: NDArray[np.bool_]) -> float:
        """v(n-1/2) . M v(n+1/2) / 2 of some nodes [J], as records have it."""
        return float(0.5 * self.solver.model.mass[mask] @ (before[mask] * after[mask]).sum(axis=1))

    @staticmethod
    def _arrays(state: State) -> list[wp.array]:
        """Of nodes, and of rigid bodies."""
        return [state.v, state.rigid.momentum, state.rigid.spin]
