"""Owns runs of pure finite elements: the flexible model from the release on, its swing included.

The swing is recorded in long intervals and searches for contact rarely. It goes on block by block; when a link has
touched something, the state at the start of that block comes back, and the same steps follow with the scene's own
output interval, until `duration` after the touch. What decides depends on the state alone, so that a run that goes on
from its checkpoint gives the same bits as one that was never interrupted.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, replace

import numpy as np

from warp_mca.base.errors import GuardError, bad_value
from warp_mca.base.log import warn
from warp_mca.geometry.mesh import Mesh
from warp_mca.kernels.records.columns import NORMAL_IMPULSE
from warp_mca.model.precision import check_range
from warp_mca.phases.arguments import Progress
from warp_mca.phases.checkpoint import Checkpoint, damage_explained, go_on
from warp_mca.phases.division import coarser
from warp_mca.phases.every import METHOD
from warp_mca.phases.forecast import announce
from warp_mca.phases.impact import Impact
from warp_mca.phases.prepare import Clock, place
from warp_mca.phases.pure_setup import Place, angles_of, check, is_of_link
from warp_mca.phases.rate_groups import grouping
from warp_mca.phases.settings import Settings
from warp_mca.rigid.handoff import at_release
from warp_mca.rigid.placement import link_placements
from warp_mca.scene import Scene
from warp_mca.step.records import SceneRecords
from warp_mca.step.state_figures import joint_impulses
from warp_mca.step.steps import Steps

SWING_INTERVAL = 1e-4  # between rows of the swing [s]
BLOCK = 10  # rows of the swing, or 1 ms: what is done again when something has touched in it
LATEST = 1.5, 0.01  # times the touch of rigid links, and [s] more: by then flexible ones must have touched
LOOK = 100  # rows between two looks whether something has touched, once it is near


class PureRun:
    """A run of pure finite elements.

    Attributes:
        place: where it is.
        impact: solver and state.
        touch: the hand-off of rigid links.
        clock: wall-clock time.
        fine: rows as the scene asks for.
        coarse: those of the swing.
        swing: what the swing has recorded, once it is over.
    """

    def __init__(
        self, scene: Scene, meshes: Mapping[str, Mesh] | None, span: float, settings: Settings, tell: Progress
    ) -> None:
        """Mesh, assemble and compile.

        Args:
            scene: with a rigid phase.
            meshes: finished meshes by body, or None.
            span: simulated time after the touch [s].
            settings: device, precision and threads.
            tell: told of stages.

        Raises:
            RequestError: the request cannot be carried out.
        """
        check(scene)
        self.clock, self.tell, self.span, self.settings = Clock(), tell, span, settings
        self.place, self.swing = Place(), SceneRecords()
        placed = place(scene, meshes, self.clock, tell, by=at_release)
        start, groups = placed.start, grouping(scene, span, settings.device, settings.multi_rate)
        ready = placed.ready(start.positions, start.velocities, grouping=groups)
        check_range(ready.model, settings.precision)
        self.clock.lap("mesh")
        assert start.touch is not None
        self.touch = start.touch
        warn(ready.warnings)
        tell("compile", 0.0)
        assert self.touch.swing is not None and self.touch.chain is not None
        interval, predicted = scene.impact.output_interval, self.touch.swing.t_end
        self.rows = max(1, round(span / interval))
        latest = LATEST[0] * predicted + LATEST[1]
        self.impact = Impact([ready], interval * (math.ceil(latest / interval) + self.rows), **settings.solver)
        self.fine = self.impact.steps
        joined = max(1, round(SWING_INTERVAL / self.fine.interval))
        blocks = math.ceil(latest / (BLOCK * joined * self.fine.interval))
        speed = max(float(np.linalg.norm(v, axis=1).max()) for v in self.touch.velocities.values())
        self.coarse = coarser(self.fine, ready.model, joined, BLOCK * (blocks + 1), speed)
        announce(self.impact)
        self.impact.divide_anew(self.coarse)
        self.links = [link.body for link in self.touch.chain.links]
        self.passes = [k for k, item in enumerate(ready.model.passes) if is_of_link(scene, item.contact, self.links)]
        if not self.passes:
            raise bad_value("Scene.contacts", (), "no link can touch anything; give a Contact of a link")
        self._angles = angles_of(self.touch)
        self.clock.lap("compile")

    def run(self, checkpoint: Checkpoint | None) -> None:
        """To the end, from where an earlier run of the same request was.

        Raises:
            RequestError: the folder holds the state of another request.
            GuardError: the run lost its footing, or nothing touched.
            McaError: the state cannot be written.
        """
        if checkpoint:
            checkpoint.is_for(self.impact, self.span, self.settings, METHOD)
            self._restore(checkpoint)
            checkpoint.begin(self.impact)
        if self.place.phase == "swing":
            self._swing(checkpoint)
        self._look_closely(checkpoint)
        go_on(self.impact, checkpoint, self._told, lambda: self._store(checkpoint))
        self._check(self.place.swung)
        self._lap("impact")

    @property
    def begin(self) -> float:
        """When the rows of the impact begin, from the release [s]."""
        return self.place.swung * self.fine.dt

    def _swing(self, checkpoint: Checkpoint | None) -> None:
        """Block by block until a link touches; the state is then that at the start of the block."""
        impact, block = self.impact, BLOCK * self.coarse.per_interval
        held = impact.state.copy()
        while True:
            if impact.state.steps + block >= self.coarse.count:
                raise GuardError(
                    f"nothing touched until t = {impact.state.steps * self.fine.dt:.4g} s, where rigid links touch "
                    f"at {self._predicted:.4g} s: let the scene's links be stiffer, or run it without --method pure-fem"
                )
            impact.advance(until=impact.state.steps + block)
            if self._first_touch(BLOCK) is not None or self._presses():
                impact.stopped = [None]  # a guard that rightly stopped the block does so again
                break
            self._check(0)
            held.assign(impact.state)
            self._note_configuration()
            self.tell("impact", min(1.0, impact.state.steps * self.fine.dt / (self._predicted + self.span)))
            if checkpoint and checkpoint.is_due(impact):
                self._store(checkpoint)
        impact.state.assign(held)
        self.place.phase, self.place.swung = "impact", held.steps
        self.place.joint_impulse = joint_impulses(impact.solver, impact.state)
        # what the block has touched is in the next rows again; the rest of the swing is recorded
        self.swing = impact.divide_anew(self.fine)[0]
        self._lap("swing")

    def _look_closely(self, checkpoint: Checkpoint | None) -> None:
        """Find the row of the touch, and let the impact end `rows` after its interval began."""
        impact, look = self.impact, max(1, min(LOOK, self.rows // 2))
        if checkpoint:
            checkpoint.begin(impact)
        while self.place.touch is None:
            impact.advance(until=impact.state.steps + look * self.fine.per_interval)
            self._check(self.place.swung)
            self.place.touch = self._first_touch(impact.rows)
        impact.take(self._ending(self.place.touch))

    def _ending(self, touch: int) -> Steps:
        """Rows of the impact until `span` after the touch, which is in the interval of this row."""
        return replace(self.fine, intervals=touch - 1 + self.rows)

    def _first_touch(self, last: int) -> int | None:
        """First of the last rows in whose interval a link was pressed, or None."""
        ledger = self.impact.scene_runs[0].ledger
        first = max(0, ledger.kept.count - last)
        pressed = (ledger.springs(ledger.table(first))[:, self.passes, NORMAL_IMPULSE] > 0.0).any(axis=1)
        return first + int(pressed.argmax()) if pressed.any() else None

    def _presses(self) -> bool:
        """Whether a link was pressed since the last row."""
        springs = [self.impact.state.contacts[k].spring for k in self.passes]
        return any(bool((spring.normal_impulse.numpy() > 0.0).any()) for spring in springs)

    def _check(self, swung: int) -> None:
        """Raise what a guard said, whose times count from the first of the rows.

        Raises:
            GuardError: a guard stopped the run.
        """
        if (words := self.impact.stopped[0]) is not None:
            counted = f" (counted from {swung * self.fine.dt:.6g} s after the release)" if swung else ""
            raise GuardError(words + counted)

    def _note_configuration(self) -> None:
        """Compare the nodes of the links with rigid links, until these touch."""
        t = self.impact.state.steps * self.fine.dt
        if t > self._predicted:
            return
        model, chain = self.impact.solver.model, self.touch.chain
        assert chain is not None
        theta = self._angles(t)
        placed = link_placements(chain.moved_to(t), theta, np.zeros_like(theta))
        u, far, reach = self.impact.state.u.numpy(), 0.0, 0.0
        for name in self.links:
            points = self.impact.ready[0].meshes[name].points
            own = slice(model.node_start[name], model.node_start[name] + len(points))
            apart = model.X[own] + u[own] - placed[name].place(points)[0]
            far = max(far, float(np.linalg.norm(apart, axis=1).max()))
            reach += float(np.ptp(points, axis=0).max())
        self.place.configuration.append([t, far / reach])

    @property
    def _predicted(self) -> float:
        """When rigid links touch [s]."""
        assert self.touch.swing is not None
        return self.touch.swing.t_end

    def _told(self) -> None:
        past = self._predicted + self.impact.rows * self.fine.interval
        self.tell("impact", min(1.0, past / (self._predicted + self.span)))

    def _lap(self, phase: str) -> None:
        """Count the time since the last lap to finite elements, and to a phase."""
        before = self.clock.wall["fe"]
        self.clock.lap("fe")
        self.place.wall[phase] = self.place.wall.get(phase, 0.0) + self.clock.wall["fe"] - before

    def _store(self, checkpoint: Checkpoint | None) -> None:
        if checkpoint is None:
            return
        self._lap(self.place.phase)
        more = self.swing.arrays() if self.place.phase == "impact" else {}
        wall = {**self.place.wall, **self.clock.wall}
        checkpoint.store(self.impact, asdict(replace(self.place, wall=wall)), more)

    def _restore(self, checkpoint: Checkpoint) -> None:
        """Go on from what an earlier run of the same request stored."""
        found = checkpoint.stored()
        if found is None:
            return
        place, more, _ = found
        with damage_explained(checkpoint.path):
            self.place = Place.of(place)
            for stage in self.clock.wall:
                self.clock.wall[stage] += self.place.wall.pop(stage)
            if self.place.phase == "impact":
                self.swing = SceneRecords.of(more)
                self.impact.steps = self.fine if self.place.touch is None else self._ending(self.place.touch)
        self.impact.load(checkpoint.path)
