"""Owns the figures of one scene that are read off a state when its run ends, and the motion at its last record."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.base.rotation import mean_pose, rotation_vector
from warp_mca.system.reading import on_host
from warp_mca.system.rigid import RigidExtremes

if TYPE_CHECKING:
    from warp_mca.step.solver import Solver
    from warp_mca.system.model import Model
    from warp_mca.system.state import State


def max_plastic_strain(solver: Solver, state: State, scene: int = 0) -> float:
    """Greatest equivalent plastic strain of any integration point of a scene [-]."""
    ranges = zip(solver.elements, solver.layout.elements[scene].tolist(), strict=True)
    found = (s.max_plastic_strain(state, slice(a - s.block.first, b - s.block.first)) for s, (a, b) in ranges)
    return max(found, default=0.0)


def max_penetration(solver: Solver, state: State, scene: int = 0) -> float:
    """Greatest depth that a slave node of a scene reached below its master [m]."""
    return max((float(stage.depths(state, scene).max(initial=0.0)) for stage in solver.contacts), default=0.0)


def max_normal_force(solver: Solver, state: State, scene: int = 0) -> float:
    """Greatest sum of the normal forces on all slave nodes of a scene in any step [N]."""
    return solver.contacts.normal_force.greatest(state.normal_force, scene)


def max_speed(solver: Solver, state: State, scene: int = 0) -> float:
    """Greatest speed of any node of a scene, from the start on [m/s]."""
    first, end = solver.layout.nodes[scene : scene + 2]
    squares = on_host(state.speed_square)
    return math.sqrt(squares[first:end].max() if len(squares) > 1 else squares[0])


def at_last_record(solver: Solver, state: State, nodes: slice = slice(None)) -> tuple[Array, Array]:
    """Displacements [m] and velocities [m/s] of nodes at the last record, each shape (node_count, 3), float64.

    A record is followed by a step, which is taken back; the velocity is the mean of both half steps around the record.
    """
    u, after, dt = solver.nodes.at_record(state)
    v = on_host(after)[nodes]
    return on_host(u)[nodes] - dt * v, 0.5 * (on_host(solver.work.v_before)[nodes] + v)


def motion_at_the_end(solver: Solver, state: State, nodes: slice, stopped: bool) -> tuple[Array, Array]:
    """As `at_last_record`, but as they are where a guard stopped the run."""
    fields = (on_host(state.u)[nodes], on_host(state.v)[nodes]) if stopped else at_last_record(solver, state, nodes)
    u, v = (np.asarray(field, dtype=np.float64) for field in fields)
    return u, v


def rigid_bodies(model: Model, u: Array, v: Array) -> dict[str, dict[str, object]]:
    """What moves each rigid body of a scene, riders included, by name.

    Mass [kg], inertia about the centre at the start [kg m^2]; mass centre and its displacement [m], rotation since the
    start as a vector [rad], momentum [kg m/s] and spin about the centre [kg m^2/s].

    Args:
        model: of that scene alone.
        u, v: displacements [m] and velocities [m/s] of its nodes, each shape (node_count, 3), float64.
    """
    found: dict[str, dict[str, object]] = {}
    for body in model.rigid_bodies:
        own = {"mass": body.mass, "inertia": body.inertia.tolist()}
        found[body.name] = own | _motion(body.centre, *(field[body.nodes] for field in (model.mass, model.X, u, v)))
    return found


def _motion(centre: Array, m: Array, X: Array, u: Array, v: Array) -> dict[str, object]:
    """As in `rigid_bodies`, of nodes of masses m at X whose mass centre was there at the start."""
    way = m @ u / m.sum()
    x, centre = X + u, centre + way
    return {
        "centre": centre.tolist(),
        "displacement": way.tolist(),
        "rotation": rotation_vector(mean_pose(X, x, m)[2]).tolist(),
        "momentum": (m @ v).tolist(),
        "spin": (m @ np.cross(x - centre, v)).tolist(),
    }


def rigid_extremes(solver: Solver, state: State, scene: int) -> RigidExtremes | None:
    """What single steps say of the rigid bodies of a scene, for warnings; None without such bodies."""
    bodies = [body.scene == scene for body in solver.model.rigid_bodies]
    if not any(bodies):
        return None
    joints, own = np.array([item.scene == scene for item in solver.model.body_joints], dtype=bool), state.rigid.joints
    alone, rank = (own.alone.numpy()[joints], own.rank.numpy()[joints]) if own else (np.zeros((0, 2)), np.zeros((0, 4)))
    return RigidExtremes(dt=solver.nodes.dt, turn=state.rigid.turn.numpy()[bodies], alone=alone, rank=rank)


def flexible_bodies(model: Model, u: Array, v: Array, names: Sequence[str]) -> dict[str, dict[str, object]]:
    """What moves flexible bodies of a scene, by name: as `rigid_bodies`, rotation as a mean, and kinetic energy [J].

    Args:
        model, u, v: as there.
        names: of the bodies.
    """
    starts = sorted([*model.node_start.values(), model.node_count])
    found: dict[str, dict[str, object]] = {}
    for name in names:
        first = model.node_start[name]
        own = slice(first, starts[starts.index(first) + 1])
        m, X = model.mass[own], model.X[own]
        kinetic = 0.5 * float(m @ (v[own] ** 2).sum(axis=1))
        found[name] = {"mass": float(m.sum()), **_motion(m @ X / m.sum(), m, X, u[own], v[own]), "kinetic": kinetic}
    return found


def joint_impulses(solver: Solver, state: State, scene: int = 0) -> dict[str, list[float]]:
    """Impulse that each joint of a scene gave to its first body [N s], by name.

    That of joints between whole bodies is the one up to the last record, others are half a step ahead.
    """
    impulse = on_host(state.constraints.impulse)
    joints = solver.model.joints[solver.layout.joints[scene] : solver.layout.joints[scene + 1]]
    found = {joint.name: impulse[joint.start : joint.end].sum(axis=0).tolist() for joint in joints}
    if (whole := solver.model.body_joints) and solver.rigid.joints:
        given = solver.rigid.joints.step.load.numpy().reshape(len(whole), -1)[:, :3]
        found |= {item.name: own.tolist() for item, own in zip(whole, given, strict=True) if item.scene == scene}
    return found
