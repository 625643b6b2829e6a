"""Owns what a run says of initial velocities that contradict what holds the bodies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from warp_mca.geometry.mesh import Mesh
    from warp_mca.model.model import Model
    from warp_mca.scene import Scene

LOST = 1e-3  # of the kinetic energy that bodies were given, from which on a word is said of its loss
STRETCH = 1e-3  # of a set of fixed nodes in a run


def start_warnings(
    scene: Scene, meshes: Mapping[str, Mesh], model: Model, kinetic: float, time: float
) -> Iterator[str]:
    """One sentence for joints that take velocities away, and for each fixed set that is pulled apart.

    Args:
        scene, meshes, model: of the run.
        kinetic: energy at the first record [J].
        time: that the run takes [s].
    """
    with np.errstate(over="ignore"):  # what is beyond all numbers is stopped elsewhere
        given = 0.5 * float((model.mass * (model.V**2).sum(axis=1)).sum())
    held = " and ".join([*(f"joint {joint.name}" for joint in scene.joints), *(tie.title for tie in scene.ties)])
    # what nodes are driven to is not what they were given
    # of bodies let go at rest under a load, the first kinetic energy (v half a step before times v after) is below 0
    if held and given > 0.0 and not len(model.prescribed_node) and given - kinetic > LOST * given:
        yield (
            f"{given - kinetic:.3g} J of the {given:.3g} J of kinetic energy that bodies were given are lost at the "
            f"start, because their velocities contradict {held}; energies and joint_impulse begin behind it: give "
            "velocities that these allow, as an angular_velocity to a body that turns about its hinge"
        )
    for item in scene.fixed:
        nodes = meshes[item.body].nodes(item.nodes) + model.node_start[item.body]
        axes = ["xyz".index(axis) for axis in item.axes]
        place, speed = (field[nodes] - field[nodes].mean(axis=0) for field in (model.X, model.V))
        before, after = (np.linalg.norm(x[:, axes], axis=1) for x in (place, place + time * speed))
        size = float(np.linalg.norm(place, axis=1).max(initial=0.0))
        if (stretch := float(np.abs(after - before).max(initial=0.0))) > STRETCH * size:
            yield (
                f"fixed nodes {item.nodes} of {item.body} keep velocities that differ: on their straight ways their "
                f"places change by {stretch / size:.2g} of their set's size, and the body with them; a set that turns "
                "with its body is held by a joint, one at rest needs a body without angular_velocity"
            )
