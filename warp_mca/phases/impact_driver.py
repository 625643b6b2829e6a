"""Owns the impact phases of a cycle: from a touch until all contacts have been open for a while."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import GuardError
from warp_mca.kernels.records.columns import NORMAL_IMPULSE
from warp_mca.phases.carry_out import Course, begin
from warp_mca.phases.film import Film
from warp_mca.phases.forecast import announce
from warp_mca.phases.impact import Impact
from warp_mca.phases.motion import ImpactPart, Motion
from warp_mca.phases.plastic_history import give_history
from warp_mca.phases.prepare import Prepared, Setup
from warp_mca.phases.residual import Relaxation, Shape
from warp_mca.phases.return_to_rigid import return_to_rigid
from warp_mca.physics.elements.cells import body_materials
from warp_mca.rigid.placement import link_placements
from warp_mca.step.solver import Solver
from warp_mca.system.state import State
from warp_mca.system.workspace import ROWS

Array = NDArray[np.float64]
ByBody = dict[str, Array]

# Period of the first bending of a uniform rod with a hinge at one end, T = 2 pi L^2 / (3.9266^2 c kappa): wave speed c
# of a bar, radius of gyration kappa of the cross-section.
BENDING = 2.0 * math.pi / 3.9266**2


class ImpactDriver:
    """Runs impacts by finite elements, and hands back to rigid bodies.

    Attributes:
        count: impacts so far.
        open_time: how long all contacts must be open for an impact to end [s].
    """

    def __init__(self, setup: Setup) -> None:
        self.setup, self.count, self.open_time = setup, 0, open_time(setup)
        self.film: Film | None = None
        self._relaxation: Relaxation | None = None
        self._prepared: tuple[Motion | None, tuple[Prepared, ByBody, ByBody]] | None = None

    def run(self, motion: Motion | None) -> tuple[Motion | None, ImpactPart]:
        """From a touch to rigid motion again, or to the end of the run: then there is no motion.

        Raises:
            GuardError: the impact lost its footing.
        """
        assert motion is not None
        setup, self.count = self.setup, self.count + 1
        ready, u, V = self.prepare(motion)
        relaxation = self._relaxation = Relaxation(ready.model, setup.request.settings, self._relaxation)
        settled: list[Shape] = []
        span = min(setup.request.span, setup.t_end - motion.t)
        shape = self._shape(motion, relaxation, u, settled) if motion.shapes else None
        film = self.film
        shown = {"skins": film.surfaces, "needs": film.needs} if film else {}
        impact = begin([ready], setup.request, span, shape=shape, **shown)
        if film:
            film.watch(impact, motion.t)
        if self.count == 1:
            announce(impact)
        self._advance(impact)
        setup.request.clock.lap("fe")
        if impact.stopped[0] is not None:
            raise GuardError(f"impact {self.count}: {impact.stopped[0]}")
        rows = impact.scene_runs[0].ledger.kept.count - 1
        in_full = "duration" if span == setup.request.span else "t_end"
        ended_by = "separation" if rows < impact.steps.intervals else in_full
        part = ImpactPart(
            start=motion.t,
            end=motion.t + rows * impact.steps.interval,
            ended_by=ended_by,
            impact=impact,
            theta=setup.chain.angles(motion.theta),
            jump=setup.kinetic(V) + setup.carriage_kinetic(motion) - setup.rigid_kinetic(motion),
            settled=sum(motion.strain_energy - shape.strain_energy for shape in settled),
        )
        if ended_by == "t_end":
            return None, part
        if ended_by == "duration" and self._pressed(impact, -1):
            why = f"impact {self.count} had not ended after duration = {span:g} s; give a longer one"
            return None, replace(part, stopped=f"the run ends at t = {part.end:.4g} s: {why}")
        back = return_to_rigid(setup, motion, part, relaxation, film is not None)
        setup.request.clock.lap("rigid")
        return back

    def prepare(self, motion: Motion) -> tuple[Prepared, ByBody, ByBody]:
        """The scene with its bodies where they are; displacements [m] and velocities [m/s] of the nodes by body.

        Nodes without displacement lie where the undeformed chain has them, so that those of hinges coincide.
        """
        if self._prepared is None or self._prepared[0] is not motion:
            self._prepared = motion, self._assemble(motion)
        return self._prepared[1]

    def _assemble(self, motion: Motion) -> tuple[Prepared, ByBody, ByBody]:
        setup, first = self.setup, not motion.shapes
        placed = setup.chain.moved_to(motion.t)
        plain = {**motion.placements, **link_placements(placed, motion.theta, motion.theta_dot)}
        X, u, V = {}, {}, {}
        for body in setup.scene.bodies:
            name, points = body.name, setup.meshes[body.name].points
            X[name], V[name] = plain[name].place(points)
            if motion.shapes:
                deformed, V[name] = motion.placements[name].place(motion.points(name, points))
                u[name] = deformed - X[name]
        watched = [(link.body, node) for link in setup.chain.links for node in setup.link_ends(link.body)]
        mismatch = dict.fromkeys(("momentum_mismatch", "angular_momentum_mismatch", "energy_mismatch"), 0.0)
        start = None if first else replace(setup.start, **mismatch)  # those are of the first hand-off
        ready = setup.ready(X, V, motion.t, start=start, watched=watched, said=first)
        return ready, u, V

    def _shape(
        self, motion: Motion, relaxation: Relaxation, u: ByBody, settled: list[Shape]
    ) -> Callable[[Solver, State], None]:
        """What gives a new state the shape and history that earlier impacts left, in equilibrium at the new angles."""
        rotations = {name: placement.rotation for name, placement in motion.placements.items()}

        def shape(solver: Solver, state: State) -> None:
            self.setup.request.clock.lap("compile")
            give_history(solver, state, motion.history, rotations)
            found = relaxation.settle(np.concatenate([u[body.name] for body in self.setup.scene.bodies]), state)
            found.give(state)
            settled.append(found)
            self.setup.request.clock.lap("rigid")

        return shape

    def _advance(self, impact: Impact) -> None:
        """Until all contacts have been open for a while, or to the end of its time."""
        scene_run, interval, wait = impact.scene_runs[0], impact.steps.interval, self.open_time
        contacts = len(scene_run.ready.model.passes)

        def told() -> None:
            self.setup.request.tell("impact", impact.rows / (impact.steps.intervals + 1))

        def ended() -> bool:
            rows = _rows_read(impact)
            if (rows - 1) * interval < wait or not contacts:
                return False
            return not self._pressed(impact, rows - math.ceil(wait / interval), rows)

        if store := self.setup.request.store:
            store.rows = ROWS // math.gcd(ROWS, impact.steps.checks)
        span = impact.steps.interval * impact.steps.intervals
        Course(impact, replace(self.setup.request, span=span), number=self.count).run((), told, ended=ended)

    def _pressed(self, impact: Impact, first: int, end: int | None = None) -> bool:
        """Whether a contact was closed in the rows of the history from `first` to the one before `end`."""
        ledger = impact.scene_runs[0].ledger
        springs = ledger.springs(np.array(ledger.kept.sums[first:end]))
        return bool((springs[..., NORMAL_IMPULSE] > 0.0).any())


def _rows_read(impact: Impact) -> int:
    """Rows that a run which never pauses has read by now: the end of an impact must not depend on when it was stored.

    Records come in sets of `ROWS`; a run pauses only where a set is complete.
    """
    steps = impact.steps
    records = impact.state.steps // steps.per_interval * steps.checks
    return -(-((records - 1) // ROWS * ROWS) // steps.checks) if records else 0


def open_time(setup: Setup) -> float:
    """How long all contacts must be open for an impact to end [s]: as the scene says, or the longest bending period."""
    asked = setup.scene.impact.open_time
    if asked is not None:
        return asked
    links = [link.body for link in setup.chain.links]
    bends = [name for name in links if not setup.scene.body(name).rigid] or links
    return max(bending_period(setup, name) for name in bends)


def bending_period(setup: Setup, name: str) -> float:
    """Longest period of bending of a link, taken for a uniform rod with a hinge at one end [s].

    Length and radius of gyration of its cross-section follow from the second moments of its mass.
    """
    points, mass = setup.meshes[name].points, setup.masses[name]
    arms = points - mass @ points / mass.sum()
    _, across, along = np.linalg.eigvalsh(np.einsum("n,ni,nj->ij", mass, arms, arms) / mass.sum())
    materials = body_materials(setup.scene.body(name), setup.meshes[name])
    slowest = min(material.wave_speeds["bar"] for material, _ in materials)
    return BENDING * 12.0 * along / (slowest * math.sqrt(across))
