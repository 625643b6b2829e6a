"""Owns the swing by finite elements, from the release until a link touches something.

The swing is recorded in long intervals and searches for contact rarely. It goes on block by block; when a link has
touched something, the state at the start of that block comes back, and the same steps follow with the scene's own
output interval, until `duration` after the touch. What decides depends on the state alone, so that a run that goes on
from its checkpoint gives the same bits as one that was never interrupted.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_mca.base.errors import GuardError, bad_value
from warp_mca.base.validate import is_list
from warp_mca.kernels.records.columns import NORMAL_IMPULSE
from warp_mca.phases.checkpoint import damage_explained
from warp_mca.phases.division import coarser
from warp_mca.phases.stretch import Stretch, stretch_ended
from warp_mca.rigid.placement import link_placements
from warp_mca.scene import ContactAll, RigidPlane, Scene
from warp_mca.step.state_figures import joint_impulses

if TYPE_CHECKING:
    from warp_mca.phases.carry_out import Course
    from warp_mca.phases.prepare import Prepared

SWING_INTERVAL = 1e-4  # between rows of the swing [s]
BLOCK = 10  # rows of the swing, or 1 ms: what is done again when something has touched in it
LATEST = 1.5, 0.01  # times the touch of rigid links, and [s] more: by then flexible ones must have touched
LOOK = 100  # rows between two looks whether something has touched, once it is near


class FlexibleSwing:
    """The swing of finite elements before an impact.

    Attributes:
        predicted: when rigid links touch [s].
        rows: of the impact, from the interval of the touch on.
        span: longest time that swing and impact take [s].
        configuration: times [s] and greatest distances of the links' nodes from those of rigid links, as shares of the
            chain's reach [-].
    """

    def __init__(self, ready: Prepared, duration: float) -> None:
        """Of a scene at its release, whose impact lasts `duration` [s] from the touch on.

        Raises:
            RequestError: no link can touch anything.
        """
        from scipy.interpolate import CubicHermiteSpline

        touch, interval = ready.start.touch, ready.scene.impact.output_interval
        assert touch is not None and touch.swing is not None and touch.chain is not None
        self.touch, self.chain, self.predicted = touch, touch.chain, touch.swing.t_end
        self.rows, self.latest = max(1, round(duration / interval)), LATEST[0] * self.predicted + LATEST[1]
        self.span = interval * (math.ceil(self.latest / interval) + self.rows)
        self.links = [link.body for link in touch.chain.links]
        passes = enumerate(ready.model.passes)
        self.passes = [k for k, item in passes if _is_of_link(ready.scene, item.contact, self.links)]
        if not self.passes:
            raise bad_value("Scene.contacts", (), "no link can touch anything; give a Contact of a link")
        self._angles = CubicHermiteSpline(touch.swing.t, touch.swing.theta_t, touch.swing.theta_dot_t)
        self.configuration: list[list[float]] = []

    def carried_out_by(self, course: Course) -> None:
        """Be a phase of the solver of a course."""
        self.course, self.impact, self.fine = course, course.impact, course.impact.steps

    def restore(self, running: Any) -> None:
        """Go on from what the swing stored on its way.

        Raises:
            RequestError: the file is damaged.
        """
        assert self.course.store is not None
        with damage_explained(self.course.store.path):
            if not (isinstance(running, list) and all(map(is_list, running))):
                raise ValueError(running)
        self.configuration = running

    def advance(self, impact: Any, tell: Callable[[float], None]) -> Stretch:
        """Block by block until a link touches; the state is then that at the start of the block.

        Raises:
            GuardError: a guard stopped it, or nothing touched.
        """
        impact, fine, store = self.impact, self.fine, self.course.store
        joined = max(1, round(SWING_INTERVAL / fine.interval))
        blocks = math.ceil(self.latest / (BLOCK * joined * fine.interval))
        speed = max(float(np.linalg.norm(v, axis=1).max()) for v in self.touch.velocities.values())
        coarse = coarser(fine, impact.ready[0].model, joined, BLOCK * (blocks + 1), speed)
        impact.take(coarse)
        block, held = BLOCK * coarse.per_interval, impact.state.copy()
        if store:
            store.begin(impact)
        while True:
            if impact.state.steps + block >= coarse.count:
                raise GuardError(
                    f"nothing touched until t = {impact.state.steps * fine.dt:.4g} s, where rigid links touch "
                    f"at {self.predicted:.4g} s: let the scene's links be stiffer, or run it without --method pure-fem"
                )
            impact.advance(until=impact.state.steps + block)
            if self.first_touch(BLOCK) is not None or self._presses():
                impact.stopped = [None]  # a guard that rightly stopped the block does so again
                break
            self.check(0)
            held.assign(impact.state)
            self._note_configuration()
            tell(impact.state.steps * fine.dt)
            if store and store.is_due(impact):
                self.course.keep(list(self.configuration))
        impact.state.assign(held)
        impulses = joint_impulses(impact.solver, impact.state)
        # what the block has touched is in the next rows again; the rest of the swing is recorded
        found = stretch_ended(impact, "swing", "touch", fine)
        self.course.clock.lap("fe")
        more = {"joint_impulse": impulses, "configuration": self.configuration, "wall": self.course.clock.wall["fe"]}
        return replace(found, more=more)

    def look_closely(self) -> None:
        """Find the row of the touch, and let the impact end `rows` after its interval began.

        Raises:
            GuardError: a guard stopped it.
        """
        impact, look = self.impact, max(1, min(LOOK, self.rows // 2))
        if store := self.course.store:
            store.begin(impact)
        touch = None
        while touch is None:
            impact.advance(until=impact.state.steps + look * self.fine.per_interval)
            self.check(self.course.stretches[0].count)
            touch = self.first_touch(impact.rows)
        impact.take(replace(self.fine, intervals=touch - 1 + self.rows))

    def first_touch(self, last: int) -> int | None:
        """First of the last rows in whose interval a link was pressed, or None."""
        ledger = self.impact.scene_runs[0].ledger
        first = max(0, ledger.kept.count - last)
        pressed = (ledger.springs(ledger.table(first))[:, self.passes, NORMAL_IMPULSE] > 0.0).any(axis=1)
        return first + int(pressed.argmax()) if pressed.any() else None

    def check(self, swung: int) -> None:
        """Raise what a guard said, whose times count from the first of the rows, after so many steps.

        Raises:
            GuardError: a guard stopped the run.
        """
        if (words := self.impact.stopped[0]) is not None:
            counted = f" (counted from {swung * self.fine.dt:.6g} s after the release)" if swung else ""
            raise GuardError(words + counted)

    def _presses(self) -> bool:
        """Whether a link was pressed since the last row."""
        springs = [self.impact.state.contacts[k].spring for k in self.passes]
        return any(bool((spring.normal_impulse.numpy() > 0.0).any()) for spring in springs)

    def _note_configuration(self) -> None:
        """Compare the nodes of the links with rigid links, until these touch."""
        t = self.impact.state.steps * self.fine.dt
        if t > self.predicted:
            return
        model, theta = self.impact.solver.model, self._angles(t)
        placed = link_placements(self.chain.moved_to(t), theta, np.zeros_like(theta))
        u, far, reach = self.impact.state.u.numpy(), 0.0, 0.0
        for name in self.links:
            points = self.impact.ready[0].meshes[name].points
            own = slice(model.node_start[name], model.node_start[name] + len(points))
            apart = model.X[own] + u[own] - placed[name].place(points)[0]
            far = max(far, float(np.linalg.norm(apart, axis=1).max()))
            reach += float(np.ptp(points, axis=0).max())
        self.configuration.append([t, far / reach])


def _is_of_link(scene: Scene, contact: int, links: list[str]) -> bool:
    """Whether a contact is of a link with something that is none."""
    item = scene.contacts[contact]
    if isinstance(item, ContactAll):
        return any((one in links) != (other in links) for one, other in scene.general_pairs())
    return (item.slave.body in links) != (not isinstance(item.master, RigidPlane) and item.master.body in links)
