"""Owns the rows about velocities at the start that joints, ties and fixed nodes contradict."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from warp_mca.watch.row import Finished, Values, row


@row(
    "{lost:.3g} J of the {given:.3g} J of kinetic energy that bodies were given are lost at the start, because their "
    "velocities contradict {held}; energies and joint_impulse begin behind it:",
    "give velocities that these allow, as an angular_velocity to a body that turns about its hinge",
    1e-3,
    "of that energy at most",
)
def lost_velocity(c: Finished, most: float) -> Iterator[Values]:
    """Kinetic energy of bodies that joints and ties take away at the start, where no nodes are driven."""
    given = 0.5 * float((c.model.mass * (c.model.V**2).sum(axis=1)).sum())
    held = [*(f"joint {joint.name}" for joint in c.scene.joints), *(tie.title for tie in c.scene.ties)]
    # of bodies let go at rest under a load, the first kinetic energy (v half a step before times v after) is below 0
    lost = given - c.ledger.kept.initial_kinetic
    if held and given > 0.0 and not len(c.model.prescribed_node) and lost > most * given:
        yield dict(lost=lost, given=given, held=" and ".join(held))


@row(
    "fixed nodes {nodes} of {body} keep velocities that differ: on their straight ways their places change by "
    "{share:.2g} of their set's size, and the body with them;",
    "a set that turns with its body is held by a joint, one at rest needs a body without angular_velocity",
    1e-3,
    "of the size at most",
)
def stretched_set(c: Finished, most: float) -> Iterator[Values]:
    """How far nodes of a fixed set move apart in the run."""
    time = c.ledger.steps.dt * c.steps_taken
    for item in c.scene.fixed:
        nodes = c.meshes[item.body].nodes(item.nodes) + c.model.node_start[item.body]
        axes = ["xyz".index(axis) for axis in item.axes]
        place, speed = (field[nodes] - field[nodes].mean(axis=0) for field in (c.model.X, c.model.V))
        before, after = (np.linalg.norm(x[:, axes], axis=1) for x in (place, place + time * speed))
        size = float(np.linalg.norm(place, axis=1).max(initial=0.0))
        if (stretch := float(np.abs(after - before).max(initial=0.0))) > most * size:
            yield dict(nodes=item.nodes, body=item.body, share=stretch / size)
