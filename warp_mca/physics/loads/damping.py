"""Owns the damping of bodies on the host: their nodes, Maxwell branches, and which rigid motions held nodes allow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array, Index
from warp_mca.base.errors import bad_value
from warp_mca.base.joining import AS_IS, joinable, of
from warp_mca.kernels.nodes.damping import ALL_AXES
from warp_mca.physics.loads.damping_stage import DampingStage as Stage
from warp_mca.scene.damping import Damping
from warp_mca.scene.drives import Fixed
from warp_mca.system.bodies import Bodies
from warp_mca.system.loads import LoadedNodes

if TYPE_CHECKING:
    from warp_mca.scene import Scene

__all__ = ["DampedNodes", "Stage", "build"]


@joinable
@dataclass(frozen=True, kw_only=True)
class DampedNodes(LoadedNodes):
    """A damped body.

    Attributes:
        body: its name.
        mass_rate: alpha [1/s].
        stiffness: beta [s].
        ground: whether alpha acts on all motion.
        turns: axis + 1 about which the body may turn, 0 about none, ALL_AXES about all.
        anchor: node whose velocity the body has along each axis, -1 where it is free, shape (3,), int32.
        gain: share of the stiffness of each Maxwell branch [-], shape (branch_count,), float64.
        times: relaxation time of each branch [s], shape (branch_count,), float64.
    """

    body: str = field(metadata=AS_IS)
    mass_rate: float = field(metadata=AS_IS)
    stiffness: float = field(metadata=AS_IS)
    ground: bool = field(metadata=AS_IS)
    turns: int = field(metadata=AS_IS)
    anchor: Index = field(metadata=of("nodes"))
    gain: Array = field(metadata=AS_IS)
    times: Array = field(metadata=AS_IS)

    def decays(self, mass: Array) -> Array:
        """Alpha at each node [1/s]; what goes with stiffness is of elements, see `model.damping`."""
        return np.full(len(self.node), self.mass_rate)


def build(load: Damping, assembly: Bodies) -> DampedNodes:
    """What damps a body.

    Raises:
        RequestError: it is damped twice, has bulk viscosity too, or is held in a way that hides its rigid motion.
    """
    scene, owner = assembly.scene, f"Damping of {load.body}"
    if sum(isinstance(other, Damping) and other.body == load.body for other in scene.loads) > 1:
        raise bad_value("Damping.body", load.body, "it is listed twice; give one Damping for each body")
    gain, times = load.branches()
    if (load.stiffness or len(gain)) and any(scene.impact.viscosity):
        remedy = "its rate does not go with stiffness and loss_factor of a Damping; leave one of them out"
        raise bad_value("ImpactPhase.bulk_viscosity", scene.impact.bulk_viscosity, remedy)
    first = assembly.element_start[load.body]
    own = np.unique(assembly.material[first : first + assembly.meshes[load.body].cell_count])
    if (load.stiffness or len(gain)) and any(assembly.materials[m].failure is not None for m in own):
        remedy = "its elements may fail, but their damping would go on; give mass alone, or leave failure out"
        raise bad_value("Damping.body", load.body, remedy)
    held = _held(scene, assembly, load.body)
    anchor, turns, hidden = _allowed(held, assembly, load.body)
    if load.mass and load.about == "body":
        if hidden:
            remedy = 'its held nodes let it turn about them; give "ground", which damps that too, or stiffness'
            raise bad_value(f"{owner}.about", load.about, remedy)
        for axis, drives in zip("xyz", held, strict=True):
            if len({drive for drive, _ in drives}) > 1:
                remedy = f'its nodes are driven in different ways along {axis}; give "ground"'
                raise bad_value(f"{owner}.about", load.about, remedy)
    nodes = assembly.all_nodes(load.body)
    return DampedNodes(
        node=np.arange(nodes.start, nodes.stop, dtype=np.int32),
        body=load.body,
        mass_rate=load.mass,
        stiffness=load.stiffness,
        ground=load.about == "ground",
        turns=ALL_AXES if hidden else turns,
        anchor=anchor,
        gain=gain,
        times=times,
    )


Held = Sequence[tuple[object, Index]]  # drives of nodes, each with what tells it from others


def _held(scene: Scene, assembly: Bodies, body: str) -> tuple[Held, Held, Held]:
    """Nodes of a body that are held or driven along x, y and z."""
    found: tuple[list, list, list] = ([], [], [])
    for item in (*scene.fixed, *scene.prescribed):
        if item.body == body:
            kind, axes = ("fixed", item.axes) if isinstance(item, Fixed) else ((item.times, item.velocities), item.axis)
            for axis in axes:
                found["xyz".index(axis)].append((kind, assembly.nodes(body, item.nodes)))
    return found


def _allowed(held: tuple[Held, Held, Held], assembly: Bodies, body: str) -> tuple[Index, int, bool]:
    """`anchor` and `turns` of a body, and whether held nodes allow a turn that these do not say.

    A body moves along an axis along which nothing is held, and turns about an axis where the other two are free.
    """
    nodes = [np.concatenate([np.zeros(0, np.int32), *(own for _, own in drives)]).astype(int) for drives in held]
    anchor = np.array([own[0] if len(own) else -1 for own in nodes], dtype=np.int32)
    free = anchor < 0
    turning = [axis for axis in range(3) if free[axis - 1] and free[axis - 2]]
    turns = ALL_AXES if len(turning) == 3 else turning[0] + 1 if turning else 0
    X = assembly.X[assembly.all_nodes(body)]
    rows: list[NDArray] = [np.zeros((1, 6))]
    for axis, own in enumerate(nodes):
        direction = np.tile(np.eye(3)[axis], (len(own), 1))
        arm = (assembly.X[own] - X.mean(axis=0)) / np.ptp(X, axis=0).max()
        rows.append(np.concatenate([direction, np.cross(arm, direction)], axis=1))
    rank = int(np.linalg.matrix_rank(sum(part.T @ part for part in rows)))
    return anchor, turns, 6 - rank > int(free.sum()) + len(turning)
