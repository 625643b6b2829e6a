"""Owns what the phases of a cycle share: the scene, its meshes and masses, its chain, and how it is run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from warp_mca.phases.arguments import Progress
from warp_mca.phases.motion import Motion
from warp_mca.phases.prepare import Clock, Placed
from warp_mca.phases.settings import Settings
from warp_mca.rigid.body_motion import held_axes
from warp_mca.rigid.chain import Chain
from warp_mca.rigid.placement import Placement
from warp_mca.scene import RigidPhase, Surface

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Setup(Placed):
    """A scene that goes through swings and impacts in turn, from its first hand-off on.

    Attributes:
        span: longest time that an impact lasts [s].
        settings: how it is run.
        clock, tell: wall time by stage, and who is told of stages.
    """

    span: float
    settings: Settings
    clock: Clock
    tell: Progress

    @property
    def rigid(self) -> RigidPhase:
        """The rigid phase."""
        assert self.scene.rigid is not None
        return self.scene.rigid

    @property
    def t_end(self) -> float:
        """Time from the release at which the run ends [s]."""
        assert self.scene.t_end is not None
        return self.scene.t_end

    @property
    def chain(self) -> Chain:
        """Rigid links, without deformation."""
        assert self.start.chain is not None
        return self.start.chain

    @cached_property
    def held(self) -> Mapping[str, NDArray[np.bool_]]:
        """Axes of nodes that are fixed, by body, each shape (node_count, 3), bool."""
        return held_axes(self.scene, self.meshes)

    def others(self, placements: Mapping[str, Placement]) -> float:
        """Kinetic energy of the bodies that are no links [J]."""
        links = {link.body for link in self.chain.links}
        moving = {name: p.place(self.meshes[name].points)[1] for name, p in placements.items() if name not in links}
        return float(sum(0.5 * self.masses[name] @ (V**2).sum(axis=1) for name, V in moving.items()))

    def slaves(self) -> dict[str, NDArray[np.int32]]:
        """Nodes of each link that a contact keeps out of the target."""
        target, found = self.rigid.target, {}
        for contact in self.scene.contacts:
            sides = [(contact.slave, contact.master)]
            if isinstance(contact.master, Surface):
                sides.append((contact.master, contact.slave))
            for own, other in sides:
                meets = other == target or (
                    isinstance(other, Surface) and isinstance(target, Surface) and other.body == target.body
                )
                if meets and isinstance(own, Surface):
                    nodes = np.unique(self.meshes[own.body].surface(own.nodes)[0])
                    found[own.body] = np.union1d(found.get(own.body, nodes), nodes)
        return found

    def kinetic(self, V: Mapping[str, Array]) -> float:
        """Kinetic energy of the nodes [J]."""
        return float(sum(0.5 * self.masses[name] @ (v**2).sum(axis=1) for name, v in V.items()))

    def carriage_kinetic(self, motion: Motion) -> float:
        """Kinetic energy of the carriage [J]."""
        _, velocities = self.chain.moved_to(motion.t).hinges(motion.theta, motion.theta_dot)
        return float(0.5 * self.chain.carriage_mass * (velocities[0] ** 2).sum())

    def rigid_kinetic(self, motion: Motion) -> float:
        """Kinetic energy of the chain and the other bodies [J]."""
        chain = motion.chain.moved_to(motion.t)
        return chain.kinetic_energy(motion.theta, motion.theta_dot) + self.others(motion.placements)

    def link_ends(self, name: str) -> tuple[int, int]:
        """Nodes of a link whose motion tells its angle: at its inbound hinge, and farthest from it."""
        link = next(link for link in self.chain.links if link.body == name)
        away = np.linalg.norm(self.meshes[name].points[:, :2] - np.asarray(link.hinge_in), axis=1)
        return int(away.argmin()), int(away.argmax())
