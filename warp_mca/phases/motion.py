"""Owns where a scene stands between two phases of a cycle, and what each phase adds to the run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.phases.plastic_history import BlockHistory
from warp_mca.rigid.chain import Chain
from warp_mca.rigid.handback import HandBack
from warp_mca.rigid.placement import Placement, link_placements
from warp_mca.rigid.swing import Swing

if TYPE_CHECKING:
    from warp_mca.phases.impact import Impact

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Stress:
    """What recorders show of bodies at rest.

    Attributes:
        stress: xx, yy, zz, xy, yz, xz at all nodes in the world frame [Pa], shape (node_count, 6), float32.
        von_mises: [Pa], shape (node_count,), float32.
        plastic_strain: equivalent plastic strain [-], shape (node_count,), float32.
        rotations: of the bodies by name when it was so [-], each shape (3, 3), float64.
    """

    stress: NDArray[np.float32]
    von_mises: NDArray[np.float32]
    plastic_strain: NDArray[np.float32]
    rotations: Mapping[str, Array]


@dataclass(frozen=True, kw_only=True)
class Motion:
    """Rigid motion of all bodies, and the shape and history that earlier impacts left them.

    Attributes:
        t: time from the release [s].
        chain: rigid links, with hinges where deformation has moved them.
        theta: coordinates of the chain [rad], as `Swing` has them, shape (coordinate_count,), float64.
        theta_dot: their rates, shape (coordinate_count,), float64.
        placements: pose and motion of each body by name.
        shapes: displacement of each node in its body's frame [m], by body, shape (node_count, 3), float64; empty while
            nothing has been deformed.
        history: plastic history of the elements; empty while nothing has yielded.
        elastic, plastic, hourglass: energies that the bodies hold [J].
        rest: what recorders show of the bodies; None where nothing has been deformed, or without recorders.
    """

    t: float
    chain: Chain
    theta: Array
    theta_dot: Array
    placements: Mapping[str, Placement]
    shapes: Mapping[str, Array] = field(default_factory=dict)
    history: tuple[BlockHistory, ...] = ()
    elastic: float = 0.0
    plastic: float = 0.0
    hourglass: float = 0.0
    rest: Stress | None = None

    def points(self, name: str, points: Array) -> Array:
        """Shape of a body in its frame, from its nodes without displacement [m], each shape (node_count, 3)."""
        return points + self.shapes[name] if self.shapes else points

    @property
    def strain_energy(self) -> float:
        """Of the elements, plastic work included [J]."""
        return self.elastic + self.plastic + self.hourglass


@dataclass(frozen=True, kw_only=True)
class SwingPart:
    """What a rigid phase adds to a run.

    Attributes:
        motion: at its beginning.
        swing: how the chain moved.
        kinetic: of the other bodies, which move on as they are [J].
        stopped: why the run ends here, in one sentence, or None.
    """

    motion: Motion
    swing: Swing
    kinetic: float
    stopped: str | None = None

    @property
    def ended_by(self) -> str:
        """What ended it: "touch" or "t_end"."""
        return self.swing.ended_by

    def chain(self, row: int) -> Chain:
        """The chain with its base where it is at a sample of the swing."""
        return self.motion.chain.moved_to(self.swing.t[row])

    def placements(self, row: int) -> dict[str, Placement]:
        """Pose and motion of each body by name at a sample of the swing."""
        run, placed = self.swing, self.motion.placements
        links = link_placements(self.chain(row), run.theta_t[row], run.theta_dot_t[row])
        return {name: p.after(run.t[row] - run.t[0]) for name, p in placed.items() if name not in links} | links


@dataclass(frozen=True, kw_only=True)
class ImpactPart:
    """What an impact phase adds to a run.

    Attributes:
        start, end: time from the release [s].
        ended_by: "separation", "duration" or "t_end".
        impact: as it ended.
        theta: angles of the links at the start [rad], shape (link_count,), float64.
        jump: kinetic energy of the nodes at the start less that of the rigid bodies [J].
        settled: strain energy that the shape lost when it settled at the start [J].
        back: the way back to rigid bodies; None where the run ends with the impact.
        lost: energy of vibration that the way back leaves out [J].
        jump_back: kinetic energy of the chain that swings on, less that of its nodes' rigid motion [J].
        hinge_impulse: that the inbound hinge of each link, by its body, gave when the motion became rigid [N s], shape
            (2,), float64.
        stopped: why the run ends here, in one sentence, or None.
    """

    start: float
    end: float
    ended_by: str
    impact: Impact
    theta: Array
    jump: float
    settled: float
    back: HandBack | None = None
    lost: float = 0.0
    jump_back: float = 0.0
    hinge_impulse: Mapping[str, Array] = field(default_factory=dict)
    stopped: str | None = None


Part = SwingPart | ImpactPart
