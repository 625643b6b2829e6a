"""Owns the figures of one scene that are read off a state when its run ends."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.base.rotation import rotation_vector

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
    squares = state.speed_square.numpy()
    return math.sqrt(squares[first:end].max() if len(squares) > 1 else squares[0])


def rigid_bodies(solver: Solver, state: State, scene: int = 0) -> dict[str, dict[str, object]]:
    """What moves each rigid body of a scene, by name; see `RigidState`.

    Mass [kg], inertia about the centre at the start [kg m^2]; mass centre at the end and its displacement [m], rotation
    since the start as a vector [rad]; momentum [kg m/s] and spin [kg m^2/s] at the latest half step.
    """
    own = state.rigid
    names = ("centre", "rotation", "momentum", "spin")
    way, turned, momentum, spin = (np.asarray(getattr(own, name).numpy(), dtype=np.float64) for name in names)
    return {
        body.name: {
            "mass": body.mass,
            "inertia": body.inertia.tolist(),
            "centre": (body.centre + way[k]).tolist(),
            "displacement": way[k].tolist(),
            "rotation": rotation_vector(turned[k]).tolist(),
            "momentum": momentum[k].tolist(),
            "spin": spin[k].tolist(),
        }
        for k, body in enumerate(solver.model.rigid_bodies)
        if body.scene == scene
    }


def flexible_bodies(model: Model, nodes: slice, state: State, names: Sequence[str]) -> dict[str, dict[str, object]]:
    """What moves flexible bodies of a scene, by name: as `rigid_bodies`, and kinetic energy [J].

    Args:
        model: of that scene alone.
        nodes: its nodes in the state.
        state: at the end.
        names: of the bodies.
    """
    u, v = (np.asarray(field.numpy()[nodes], dtype=np.float64) for field in (state.u, state.v))
    starts = sorted([*model.node_start.values(), model.node_count])
    found: dict[str, dict[str, object]] = {}
    for name in names:
        first = model.node_start[name]
        own = slice(first, starts[starts.index(first) + 1])
        m, x, w = model.mass[own], model.X[own] + u[own], v[own]
        centre, momentum = m @ x / m.sum(), m @ w
        found[name] = {
            "mass": float(m.sum()),
            "centre": centre.tolist(),
            "momentum": momentum.tolist(),
            "spin": (m @ np.cross(x - centre, w)).tolist(),
            "kinetic": 0.5 * float(m @ (w**2).sum(axis=1)),
        }
    return found


def joint_impulses(solver: Solver, state: State, scene: int = 0) -> dict[str, list[float]]:
    """Impulse that each joint of a scene gave to its first body [N s], by name."""
    impulse = state.constraints.impulse.numpy()
    joints = solver.model.joints[solver.layout.joints[scene] : solver.layout.joints[scene + 1]]
    found = {joint.name: impulse[joint.start : joint.end].sum(axis=0).tolist() for joint in joints}
    if whole := solver.model.body_joints:
        given = state.rigid.joints.impulse.numpy().reshape(len(whole), -1)[:, :3]
        found |= {item.name: own.tolist() for item, own in zip(whole, given, strict=True) if item.scene == scene}
    return found
