"""Owns the rows about motion: velocities that joints and fixed nodes contradict, the hand-off, bodies that creep."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from warp_mca.kernels.records.columns import FRICTION, IMPULSE, NORMAL_IMPULSE, SPRING_ENERGY
from warp_mca.watch.row import Array, Finished, Values, row

PARTS = 4  # of the second half of a run, in which a body at rest presses alike
CREEPING = 3  # of them, at least: a body that slides until it rests does not
ROWS = 5  # of a part, at least
STEADY = 0.3  # by which normal forces of the parts differ from their mean, at most
WITHIN = 0.95  # of mu F_n: friction below it in the mean does not slide
ONE_WAY = 0.8  # of the friction of rows that their vector sum keeps, at least
ELASTIC = 0.1  # of the energy of the springs: less friction work in a part is no creep


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
    time = c.steps.dt * c.steps_taken
    for item in c.scene.fixed:
        nodes = c.meshes[item.body].nodes(item.nodes) + c.model.node_start[item.body]
        axes = ["xyz".index(axis) for axis in item.axes]
        place, speed = (field[nodes] - field[nodes].mean(axis=0) for field in (c.model.X, c.model.V))
        before, after = (np.linalg.norm(x[:, axes], axis=1) for x in (place, place + time * speed))
        size = float(np.linalg.norm(place, axis=1).max(initial=0.0))
        if (stretch := float(np.abs(after - before).max(initial=0.0))) > most * size:
            yield dict(nodes=item.nodes, body=item.body, share=stretch / size)


@row(
    "the rigid phase took slender rods: momentum changes by {momentum:.1%} and kinetic energy by {energy:.1%} at "
    "hand-off;",
    "rigid_inertia=mesh keeps both",
)
def slender_rods(c: Finished, _: float) -> Iterator[Values]:
    """Change of energy at the hand-off of a rigid phase with inertia="slender"."""
    if c.scene.rigid and c.scene.rigid.inertia == "slender" and c.start.energy_mismatch > 0.0:
        yield dict(momentum=c.start.momentum_mismatch, energy=c.start.energy_mismatch)


@row(
    "{name} creeps at {speed:.2g} m/s, though friction there is {share:.0%} of what holds it: nodes whose springs open "
    "for a few steps lose their grip and slide when they close; a body that should rest moves so far, and friction "
    "takes that work;",
    "a lower penalty or a shorter time step lessens it",
    30.0,
    "times the creep at most; a body that moved further slid, or rolls with a creep of less than a hundredth",
)
def creep(c: Finished, times: float) -> Iterator[Values]:
    """Way of bodies that slide in most of the second half of a run, though friction could hold them."""
    ledger, model = c.ledger, c.model
    rows = ledger.table(ledger.kept.count // 2)
    if len(rows) <= PARTS * ROWS:
        return
    for contact, history in enumerate(c.contacts):
        own = [k for k, item in enumerate(model.passes) if item.contact == contact]
        normal = model.contact_axes[contact, 0]
        mu = max((model.passes[k].mu for k in own), default=0.0)
        if mu == 0.0 or not normal.any():
            continue
        sign = np.array([model.passes[k].sign for k in own])
        speed, share = _creep(ledger.springs(rows)[:, own], sign, normal, mu, ledger.contact_dt)
        time = c.steps.interval * (ledger.kept.count - 1)
        if speed > 0.0 and _way(c, own[0], normal, time) < times * speed * time:
            yield dict(name=history.name, speed=speed, share=share)


def _creep(springs: Array, sign: Array, normal: Array, mu: float, dt: float) -> tuple[float, float]:
    """Speed of creep [m/s], 0 where there is none, and friction over what it may be at most [-].

    In a body at rest friction takes what its mean force does: E = F_t v t. `springs`: columns of rows and passes.
    """
    ends = np.linspace(0, len(springs) - 1, PARTS + 1).astype(int)
    # a row holds the impulse of the interval before it, and the work up to its end
    pressed = _sums(springs[:, :, NORMAL_IMPULSE].sum(axis=1), ends)
    force = np.einsum("p,rpc->rc", sign, springs[:, :, IMPULSE])
    along = force - np.outer(force @ normal, normal)
    size, total = _sums(np.linalg.norm(along, axis=1), ends), np.linalg.norm(_sums(along, ends), axis=1)
    work = np.diff(springs[ends, :, FRICTION].sum(axis=1))
    held = float(springs[:, :, SPRING_ENERGY].sum(axis=1).mean())
    creeps = (size < WITHIN * mu * pressed) & (total > ONE_WAY * size) & (work > ELASTIC * held)
    mean = pressed / np.diff(ends)
    if creeps.sum() < CREEPING or mean.min() <= 0.0 or np.abs(mean / mean.mean() - 1.0).max() > STEADY:
        return 0.0, 0.0
    return float(work.sum() / (dt * total.sum())), float(total.sum() / (mu * pressed.sum()))


def _sums(values: Array, ends: NDArray[np.int_]) -> Array:
    """Of the rows after each end up to the next, shape (PARTS, ...)."""
    return np.add.reduceat(values[1:], ends[:-1], axis=0)


def _way(c: Finished, k: int, normal: Array, time: float) -> float:
    """How far the slave nodes of pass k moved along their master, in the mean [m]."""
    item = c.model.passes[k]
    plane = item.plane
    other = c.u[item.master].mean(axis=0) if plane is None else time * np.asarray(plane.velocity, dtype=float)
    way = c.u[item.slave].mean(axis=0) - other
    return float(np.linalg.norm(way - (way @ normal) * normal))
