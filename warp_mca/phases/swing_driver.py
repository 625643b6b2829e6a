"""Owns the rigid phases of a cycle: from the release, or from a separation, to the next touch of any link."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warp_mca.phases.motion import Motion, SwingPart
from warp_mca.phases.prepare import Setup
from warp_mca.rigid.chain import Array
from warp_mca.rigid.placement import link_placements
from warp_mca.rigid.swing import Swing, swing_until
from warp_mca.rigid.target import TargetPlane, TurningPlane, moving_plane, node_gap, target_plane
from warp_mca.scene import RigidPlane

CLEARANCE = 1e-3  # of a slave face's edge, that bodies are apart when a later impact begins: shapes settle by less


class SwingDriver:
    """Swings the chain of a scene; bodies that are no links move on as they are."""

    def __init__(self, setup: Setup) -> None:
        self.setup = setup

    def first(self, motion: Motion | None = None) -> tuple[Motion, SwingPart]:
        """From the release to the first touch, as the first hand-off has it."""
        start = self.setup.start
        assert start.swing is not None
        release = Motion(
            t=0.0,
            chain=self.setup.chain,
            theta=start.swing.theta_t[0],
            theta_dot=start.swing.theta_dot_t[0],
            placements=start.placements,
        )
        motion = replace(release, t=start.swing.t_end, theta=start.theta, theta_dot=start.theta_dot)
        tip, stopped = self.setup.rigid.tip.body, None
        if start.swing.ended_by == "touch" and tip not in self.setup.slaves():
            assert start.contact_point is not None
            stopped = _unknown(motion.t, tip, start.contact_point)
        kinetic = self.setup.others(start.placements)
        return motion, SwingPart(motion=release, swing=start.swing, kinetic=kinetic, stopped=stopped)

    def run(self, motion: Motion | None) -> tuple[Motion, SwingPart]:
        """From a separation to the next touch of any link."""
        assert motion is not None
        setup = self.setup
        setup.request.tell("rigid", motion.t / setup.t_end)
        plane = self._plane(motion)
        gaps = [
            node_gap(motion.chain, k, motion.points(link.body, setup.meshes[link.body].points), plane)
            for k, link in enumerate(motion.chain.links)
        ]
        clearance = self._clearance()
        apart = [lambda t, theta, gap=gap: gap(t, theta) - clearance for gap in gaps]
        run = swing_until(motion.chain, motion.theta, motion.theta_dot, apart, t_start=motion.t, t_end=setup.t_end)
        placed = motion.chain.moved_to(run.t_end)
        links = link_placements(placed, run.theta, run.theta_dot)
        placements = {name: p.after(run.t_end - motion.t) for name, p in motion.placements.items()} | links
        after = replace(motion, t=run.t_end, theta=run.theta, theta_dot=run.theta_dot, placements=placements)
        stopped = self._unknown_touch(after, run, plane) if run.ended_by == "touch" else None
        setup.request.clock.lap("rigid")
        return after, SwingPart(motion=motion, swing=run, kinetic=setup.others(motion.placements), stopped=stopped)

    def _plane(self, motion: Motion) -> TargetPlane | TurningPlane:
        """The target, which moves on."""
        target = self.setup.rigid.target
        if isinstance(target, RigidPlane):
            return target_plane(self.setup.scene, target, self.setup.meshes)
        return moving_plane(self.setup.meshes[target.body], target, motion.placements[target.body], motion.t)

    def _clearance(self) -> float:
        """How far bodies are apart at the start of a later impact [m]."""
        edges = []
        for body, nodes in self.setup.slaves().items():
            faces = self.setup.meshes[body].boundary[0]
            faces = faces[np.isin(faces, nodes).all(axis=1)]
            corners = self.setup.meshes[body].points[faces]
            edges.append(float(np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1).min()))
        return CLEARANCE * min(edges, default=0.0)

    def _unknown_touch(self, motion: Motion, run: Swing, plane: TargetPlane | TurningPlane) -> str | None:
        """Why what touched cannot be computed, or None: no contact of the scene says what happens there."""
        assert run.touched is not None
        name = motion.chain.links[run.touched].body
        world, _ = motion.placements[name].place(motion.points(name, self.setup.meshes[name].points))
        point, normal = plane.at(run.t_end)
        node = int(((world - point) @ normal).argmin())
        if node in self.setup.slaves().get(name, ()):
            return None
        return _unknown(run.t_end, name, world[node])


def _unknown(t: float, body: str, at: Array) -> str:
    """Why a run ends at time t [s], when a body touches at this point [m] and no contact says what happens there."""
    x, y, z = at
    return (
        f"the run ends at t = {t:.4g} s: {body} touches the target at ({x:.4g}, {y:.4g}, {z:.4g}) m, where no contact "
        "of the scene keeps it out; add these nodes to a Contact"
    )
