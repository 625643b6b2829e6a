"""Owns the rows about what contact springs do to motion: flutter, flat ends that ring, bodies at rest that creep."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.kernels.records.columns import FRICTION, IMPULSE, NORMAL_IMPULSE, SPRING_ENERGY, STICK_IMPULSE
from warp_mca.physics.contact.sides import face_geometry
from warp_mca.physics.elements.cells import body_materials
from warp_mca.scene import Damping
from warp_mca.watch.row import Array, Context, Finished, Values, listed_passes, row, sides_of

if TYPE_CHECKING:
    from warp_mca.scene import Contact
    from warp_mca.system.contact import ContactPass

MEAN = 5  # rows whose mean is what the surface does besides
SPAN = 20  # rows, all in contact, that vibrate
SHARE = 0.07
PARTS = 4  # of the second half of a run, in which a body at rest presses alike
CREEPING = 3  # of them, at least: a body that slides until it rests does not
ROWS = 5  # of a part, at least
STEADY = 0.3  # by which normal forces of the parts differ from their mean, at most
WITHIN = 0.99  # of mu F_n: friction of a body that slides alike is beyond it
HELD_SHARE = 0.02  # of F_n, at least, on nodes that stick: a body that slides or spins on its face has none
ONE_WAY = 0.8  # of the friction of rows that their vector sum keeps, at least
ELASTIC = 0.1  # of the energy of the springs: less friction work in a part is no creep
LINEAR = 0.01  # strain v / c up to which bodies count as linear; beyond, twice of what is more may stiffen them
ACROSS = 0.1  # component of the normal along an axis, from which on a node that is fixed there is held along the normal
HELD = 9.0 / 8.0  # times rho c A v: the most from a master that is held, whose wave comes back; docs/decisions.md


@row(
    "the surface under the tip vibrates with up to {speed:.2g} m/s, {share:.0%} of the speed at which they met, faster "
    "than rows show: friction and stiff contact springs excite its cells (flutter), which depends on mesh and penalty; "
    "take plate_vx, plate_vy, plate_vz, stick_fraction and sticks with care;",
    "a lower penalty lessens it",
    SHARE,
    "of the speed at which tip and target met, at most (docs/decisions.md)",
)
def flutter(c: Finished, most: float) -> Iterator[Values]:
    """Vibration of the target point in contact along normal and tangent, where there is friction."""
    speed, along, _ = _vibrations(c)
    if along > most * speed > 0.0:
        yield dict(speed=along, share=along / speed)


@row(
    "the surface under the tip vibrates across normal and tangent with up to {speed:.2g} m/s, {share:.0%} of the speed "
    "at which they met: contact presses nodes from one face of it to the next and back; take plate_vx, plate_vy and "
    "plate_vz in that direction with care;",
    "a lower penalty lessens it",
    0.2,
    "of the speed at which tip and target met, at most",
)
def vibration_aside(c: Finished, most: float) -> Iterator[Values]:
    """Vibration of the target point in contact across normal and tangent, where no column of forces looks."""
    speed, along, across = _vibrations(c)
    if across > most * speed > 0.0 and along <= SHARE * speed:
        yield dict(speed=across, share=across / speed)


@row(
    "the greatest force of {name}, {greatest:.3g} N, is {times:.2f} times the {most:.3g} N of waves in flat ends "
    "(rho c A v): contact springs and cells ring there; the impulse and means over several rows are right, F_n_max and "
    "single rows depend on mesh, penalty and output_interval:",
    "take means, or choose a longer output_interval",
    1.05,
    "times the greatest force of waves at most",
)
def ringing(c: Finished, times: float) -> Iterator[Values]:
    """Greatest force of flat ends over that of waves.

    Bodies that meet with speed v press on each other with Z v at most, Z = Z_1 Z_2 / (Z_1 + Z_2), where rho c A of
    either body is at least Z_k: c is the speed of dilatational waves and A the area of its shadow along the normal.
    Waves that come back from free ends only take from it. So nothing is said of bodies that have more behind them or
    meet twice: with joints, ties, loads, driven nodes, or other contacts.
    """
    for _, item, contact in listed_passes(c.scene, c.model):
        history = c.contacts[item.contact]
        greatest = float(history.pressure.max(initial=0.0))
        if not item.leads or greatest == 0.0 or not _is_first_impact(c, contact, item):
            continue
        most = _greatest_force(c, contact, item, c.ledger.steps.interval * int(history.pressure.argmax()))
        if greatest > times * most > 0.0:
            yield dict(name=history.name, greatest=greatest, times=greatest / most, most=most)


@row(
    "{name} creeps at {speed:.2g} m/s, though friction there is {share:.0%} of what holds it: nodes whose springs open "
    "for a few steps lose their grip and slide when they close; a body that should rest moves so far, one that should "
    "slide moves too far, and friction takes that work;",
    "leave the contact's law out, so that it has a dashpot at rest, or settle the bodies first: phases=(mca.Settle(),)",
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
        if mu == 0.0 or c.scene.contacts[contact].friction_laws or not normal.any():  # no record has a law's limit
            continue
        sign = np.array([model.passes[k].sign for k in own])
        speed, share = _creep(ledger.springs(rows)[:, own], sign, normal, mu, ledger.contact_dt)
        time = c.ledger.steps.interval * (ledger.kept.count - 1)
        if speed > 0.0 and _way(c, own[0], normal, time) < times * speed * time:
            yield dict(name=history.name, speed=speed, share=share)


def _vibrations(c: Finished) -> tuple[float, float, float]:
    """Speed at which tip and target met, vibration of the target along the axes of rough contacts, and across [m/s]."""
    history, passes = c.history, c.model.passes
    if not passes or len(history["time_s"]) < MEAN + SPAN:
        return 0.0, 0.0, 0.0
    tip, target = (np.column_stack([history[f"{point}_v{axis}"] for axis in "xyz"]) for point in ("tip", "plate"))
    axes = [c.model.contact_axes[item.contact] for item in passes]
    rough = [own for own, item in zip(axes, passes, strict=True) if item.mu > 0.0]
    aside = [np.cross(own[:1], own[1:]) for own in axes]
    along, across = (_amplitude(history, target, directions) for directions in (rough, aside))
    return float(np.linalg.norm(tip[0] - target[0])), along, across


def _amplitude(history: Mapping[str, Array], velocity: Array, axes: Sequence[Array]) -> float:
    """Greatest vibration in contact of a velocity [m/s] along axes, each shape (axis_count, 3)."""
    if not axes:
        return 0.0
    return vibration(velocity @ np.concatenate(axes).T, history["F_n_N"] > 0.0)


def vibration(velocity: Array, touching: NDArray[np.bool_]) -> float:
    """Greatest amplitude of what changes faster than the mean of MEAN rows, over SPAN rows in contact [m/s].

    That of a sine with the same mean square: sqrt(2) times the root mean square.

    Args:
        velocity: components at each row [m/s], shape (row_count, component_count).
        touching: rows in contact, shape (row_count,).
    """
    inner = slice(MEAN // 2, len(velocity) - MEAN // 2)
    square = (velocity[inner] - _mean(velocity)) ** 2
    windows = np.lib.stride_tricks.sliding_window_view(square, SPAN, axis=0).mean(axis=-1)
    whole = np.lib.stride_tricks.sliding_window_view(touching[inner], SPAN).all(axis=-1)
    return float(np.sqrt(2.0 * windows[whole].max(initial=0.0)))


def _mean(values: Array) -> Array:
    """Of each MEAN rows one after the other, shape (row_count - MEAN + 1, component_count)."""
    return np.lib.stride_tricks.sliding_window_view(values, MEAN, axis=0).mean(axis=-1)


def _is_first_impact(c: Finished, contact: Contact, item: ContactPass) -> bool:
    """Whether flat ends meet of bodies that only this contact moves, or that are held at rest."""
    scene = c.scene
    bound = {name for joint in scene.joints for name in (joint.body, joint.other)}
    bound |= {name for tie in scene.ties for name in (tie.slave.body, tie.master.body)}
    bound |= {name for load in scene.loads if not isinstance(load, Damping) for name in load.bodies().values()}
    bound |= {prescribed.body for prescribed in scene.prescribed}
    bound |= {name for other in scene.contacts if other is not contact for name in sides_of(other)}
    normal = c.model.contact_axes[item.contact, 0]
    return (
        normal.any()
        and scene.general is None
        and not bound.intersection(sides_of(contact))
        and not scene.body(contact.slave.body).rigid
        and not _is_held(c, contact.slave.body, normal)
        and item.initial_overlap == "refuse"
        and not item.curved
    )


def _greatest_force(c: Finished, contact: Contact, item: ContactPass, time: float) -> float:
    """Force of waves [N] up to a time [s]; gravity adds the speed of a fall so long, and twice the weight."""
    model, normal = c.model, c.model.contact_axes[item.contact, 0]
    slave, *master = sides_of(contact)
    gravity = float(np.linalg.norm(model.gravity[0]))
    speed = float((-model.V[c.nodes(slave)] @ normal).max()) + gravity * time
    Z, wave = _impedance(c, slave, normal)
    for name in master:
        speed += float((model.V[c.nodes(name)] @ normal).max())
        if _is_held(c, name, normal):
            Z *= HELD
        elif not c.scene.body(name).rigid:
            Z *= 1.0 / (1.0 + Z / _impedance(c, name, normal)[0])
    speed = max(speed, 0.0)
    stiffening = 1.0 + 2.0 * max(speed / wave - LINEAR, 0.0)
    return stiffening * Z * speed + 2.0 * gravity * float(model.mass[c.nodes(slave)].sum())


def _impedance(c: Finished, body: str, normal: Array) -> tuple[float, float]:
    """Impedance of a body times the area of its shadow [kg/s], and its greatest wave speed [m/s]."""
    Z, speed = impedance(c, body)
    return Z * shadow(c, body, normal), speed


def impedance(c: Context, body: str, wave: str = "dilatational") -> tuple[float, float]:
    """Greatest rho c [kg/(m^2 s)] of a body's materials, and the greatest c [m/s], of a wave of `wave_speeds`."""
    materials = [material for material, _ in body_materials(c.scene.body(body), c.meshes[body])]
    speeds = [material.wave_speeds[wave] for material in materials]
    return max(m.rho * speed for m, speed in zip(materials, speeds, strict=True)), max(speeds)


def shadow(c: Context, body: str, normal: Array) -> float:
    """Area of the shadow that a body casts along a unit normal [m^2].

    Of two bounds the lower one: uneven faces along the normal, as of the flank of a meshed cylinder, cast shadows too.
    """
    from scipy.spatial import ConvexHull

    faces, X = c.meshes[body].boundary[0], c.model.X[c.nodes(body)]
    across = np.linalg.svd(normal[None])[2][1:]  # two axes of the plane on which it falls
    of_faces = 0.5 * float(np.abs(face_geometry(X, faces)[1] @ normal).sum())
    return min(of_faces, float(ConvexHull(X[np.unique(faces)] @ across.T).volume))


def _is_held(c: Finished, body: str, normal: Array) -> bool:
    """Whether some of its nodes are fixed along the normal."""
    fixed = int(np.bitwise_or.reduce(c.model.fixed_axes[c.nodes(body)]))
    return any(fixed >> axis & 1 for axis in range(3) if abs(normal[axis]) > ACROSS)


def _creep(springs: Array, sign: Array, normal: Array, mu: float, dt: float) -> tuple[float, float]:
    """Speed of creep [m/s], 0 where there is none, and friction over what it may be at most [-].

    In a body at rest friction takes what its mean force does: E = F_t v t. `springs`: columns of rows and passes.
    """
    ends = np.linspace(0, len(springs) - 1, PARTS + 1).astype(int)
    # a row holds the impulse of the interval before it, and the work up to its end
    pressed = _sums(springs[:, :, NORMAL_IMPULSE].sum(axis=1), ends)
    force = np.einsum("p,rpc->rc", sign, springs[:, :, IMPULSE])
    along = force - np.outer(force @ normal, normal)
    stuck = _sums(springs[:, :, STICK_IMPULSE].sum(axis=1), ends)
    size, sums = _sums(np.linalg.norm(along, axis=1), ends), _sums(along, ends)
    total = np.linalg.norm(sums, axis=1)
    work = np.diff(springs[ends, :, FRICTION].sum(axis=1))
    held = float(springs[:, :, SPRING_ENERGY].sum(axis=1).mean())
    creeps = (
        (size < WITHIN * mu * pressed)
        & (stuck > HELD_SHARE * pressed)
        & (total > ONE_WAY * size)
        & (work > ELASTIC * held)
    )
    if np.linalg.norm(sums.sum(axis=0)) < ONE_WAY * total.sum():  # to and fro
        return 0.0, 0.0
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
