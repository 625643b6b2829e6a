"""Owns the estimate of what contact springs take of the greatest force of a contact."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.physics.contact.sides import face_geometry
from warp_mca.physics.elements.cells import body_materials
from warp_mca.scene import Contact, ContactAll
from warp_mca.watch.contacts import on_edges
from warp_mca.watch.row import Context, sides_of
from warp_mca.watch.vibration import impedance, shadow

if TYPE_CHECKING:
    from warp_mca.system.model import Model

# Relative loss of the force peak of a curved contact, or of one on edges, over the share of the exchanged energy that
# springs hold then; measured on balls, links and edges within a factor of 2, see docs/decisions.md.
PEAK_LOSS = 0.3
WAVE = 1.3  # force of a flat contact over that of one wave up to which it may be that wave
DRIVEN = 4.0  # the same of bodies that drives press on each other
RETURN = 1.5  # times in which waves are back, up to which the force is that of waves that run on
CROSSINGS = 4.0  # of a body by waves, after which a drive presses it as slowly as no wave tells
STILL = 1e-6  # share of a relative velocity along the normal up to which bodies do not approach each other
_LANDED, _ALIKE = 0.95, 1e-3  # least share of the shadow of a body that lands flat, most difference of its speeds [-]
_THIN = 0.5  # greatest height of a body over the root of its shadow: taller ones widen as bars do, and press less
_PLASTIC = 0.03  # of the exchanged energy: more plastic work limits the force
_TOWARDS = 0.5  # size of the mean normal of faces that two bodies press on each other, at least [-]
_LATEST, _HALVINGS = 40.0, 50  # times Z / k at which the force is that of the wave, and steps to find x below it


class Peak(NamedTuple):
    """A contact when its force is greatest.

    Attributes:
        share: s, of its springs in the energy that bodies have exchanged [-].
        plastic: plastic work over that energy [-].
        series: share of springs in the energy that all springs and bodies store [-].
        force: greatest force [N], inf of a bond that is pulled.
        time: since the start of the phase [s].
        pressed: time since the first touch [s].
    """

    share: float
    plastic: float
    series: float
    force: float
    time: float
    pressed: float


class Pair(NamedTuple):
    """Bodies of a contact: their names, of one alone against a plane, and the unit normal, zero if it is not known."""

    names: Sequence[str]
    normal: Array


def curved_contacts(model: Model) -> set[int]:
    """Contacts of curved surfaces."""
    return {item.contact for item in model.passes if item.curved}


def loss_of_peak(c: Context, k: int, depths: Sequence[Array], peak: Peak, end: float) -> tuple[float, str]:
    """Relative loss of the force peak of contact k [-], and what bears it, as `SpringShare.where`.

    - Curved contacts and edges lose `PEAK_LOSS` s, flat ones what `_loss_of_flat` says.
    - What lands flat on a plane loses what its force lacks of that of a wave, `_loss_of_landing`.
    - Drives that press several bodies in a general contact lose all that springs take.

    Args:
        c: scene, meshes and model.
        k: number of the contact.
        depths: of each contact pass, largest penetration of each spring [m], shape (spring_count,), float64.
        peak: of the contact.
        end: time since the start of the phase up to which bodies fall [s].
    """
    curved = k in curved_contacts(c.model)
    lands = _lands_flat(c, k, depths)  # as a round bar does with its end, though its skin is curved
    pair = _flat_pair(c, k, depths) if lands or not curved else None
    where = "edges" if pair is not None and on_edges(c, k, depths) else ""
    if pair is not None and not where and math.isfinite(_wave_forces(c, pair, end)[0]):
        where = "flat"
    if pair is not None and lands and peak.plastic <= _PLASTIC:
        loss = _loss_of_landing(c, pair, peak.force)
        if loss is not None:
            return loss, where
    if pair is not None and where != "edges":
        given = curved or c.scene.contacts[k].penalty is not None
        return _loss_of_flat(c, pair, peak, end, given), where
    if isinstance(c.scene.contacts[k], ContactAll) and not curved and _is_pressed_slowly(c, peak.time):
        return peak.series, where
    return PEAK_LOSS * peak.share, where


def _flat_pair(c: Context, k: int, depths: Sequence[Array]) -> Pair | None:
    """Bodies of contact k; of a general contact the two that press faces on each other, None of others."""
    contact = c.scene.contacts[k]
    if isinstance(contact, Contact):
        return Pair(sides_of(contact), c.model.contact_axes[k, 0])
    item, depth = next(both for both in zip(c.model.passes, depths, strict=True) if both[0].contact == k)
    assert item.pairs is not None
    pressed, pairs = depth.reshape(len(item.slave), -1).max(axis=1) > 0.0, c.scene.general_pairs()
    bodies = [body.name for body in c.scene.bodies if any(body.name in pair for pair in pairs)]
    numbers = np.unique(item.pairs.body[pressed]).tolist()
    if len(numbers) == 1:  # its nodes lie within a face of the other
        (one,) = numbers
        numbers += [n for n in np.flatnonzero(item.pairs.factor[one]).tolist() if n != one]
    if len(numbers) != 2:
        return None
    of_face = np.isin(item.slave_face, item.slave[pressed]).all(axis=1)
    area, normal = face_geometry(c.model.X, item.slave_face[of_face])
    total = np.where(item.pairs.face[of_face, None] == numbers[0], normal, -normal).sum(axis=0)
    size = float(np.linalg.norm(total))
    return Pair([bodies[n] for n in numbers], total / size) if size > _TOWARDS * area.sum() else None


def _loss_of_flat(c: Context, pair: Pair, peak: Peak, end: float, given: bool) -> float:
    """Relative loss of the peak of a flat contact; `given`: the scene gives its springs.

    - Of waves that run on from both surfaces `_loss_of_wave`, and not more than the force lacks of that of the wave.
    - Of more force than a wave gives, after waves are back, that of a mass on two springs in series, 1 - sqrt(1 - s).
    - Drives that press bodies on each other, or pull those that are bonded, lose all that springs take.
    """
    wave, most = _wave_forces(c, pair, end)
    if math.isinf(wave) and (speed := _driven_speed(c)):
        return peak.series if peak.force > DRIVEN * _wave_forces(c, pair, end, speed)[0] else 0.0
    if math.isinf(wave):
        return PEAK_LOSS * peak.share if given else 0.0
    if math.isinf(peak.force):  # of a bond that is pulled
        return 0.0
    if peak.force > WAVE * wave and peak.pressed > RETURN * _return_time(c, pair):
        return 1.0 - math.sqrt(1.0 - min(peak.share, 1.0))
    return min(_loss_of_wave(peak.share), max(0.0, 1.0 - peak.force / most))


def _loss_of_wave(share: float) -> float:
    """Relative loss a = exp(-x) of the force of waves, x = k t / Z, by the share s of the energy in springs.

    Springs k between bars whose impedance is Z, F = Z v (1 - a), hold F^2 / 2 k; waves take the integral of F^2 / 2 Z:
    s = (1 - a)^2 / (x - 1/2 + a^2 / 2), which falls as x grows.
    """
    low, high = 1e-6, _LATEST
    for _ in range(_HALVINGS):
        x = 0.5 * (low + high)
        a = math.exp(-x)
        low, high = (x, high) if (1.0 - a) ** 2 > share * (x - 0.5 + 0.5 * a * a) else (low, x)
    return math.exp(-low)


def _lands_flat(c: Context, k: int, depths: Sequence[Array]) -> bool:
    """Whether contact k is that of a body that lands on a plane with all of its shadow at once."""
    own = [(item, depth) for item, depth in zip(c.model.passes, depths, strict=True) if item.contact == k]
    contact = c.scene.contacts[k]
    if not isinstance(contact, Contact) or len(own) != 1 or own[0][0].plane is None or c.model.fails:
        return False
    (item, depth), normal, body = own[0], c.model.contact_axes[k, 0], contact.slave.body
    speed = c.model.V[c.nodes(body)] @ normal
    if not depth.any() or np.ptp(speed) > _ALIKE * np.abs(speed).max():
        return False
    pressed = item.slave[depth.reshape(len(item.slave), -1).max(axis=1) > 0.0]
    faces = item.slave_face[np.isin(item.slave_face, pressed).all(axis=1)]
    return np.abs(face_geometry(c.model.X, faces)[1] @ normal).sum() >= _LANDED * shadow(c, body, normal)


def _loss_of_landing(c: Context, pair: Pair, force: float) -> float | None:
    """Relative loss of the peak of the contact of a thin body that does not yield and lands flat.

    At first it presses with Z v A, whatever is behind; springs that are softer than a thin wall do not come to that
    before waves are back. None of other bodies, and where more than a wave presses.
    """
    (body,), normal = pair
    wave, height = _wave_forces(c, pair, 0.0)[1], float(np.ptp(c.model.X[c.nodes(body)] @ normal))
    if math.isinf(wave) or force > WAVE * wave or height > _THIN * math.sqrt(shadow(c, body, normal)):
        return None
    return max(0.0, 1.0 - force / wave)


def _is_pressed_slowly(c: Context, time: float) -> bool:
    """Whether drives press bodies on each other that were at rest, and waves crossed each of them by a time [s]."""
    if c.model.V.any() or not _driven_speed(c):
        return False
    names = [body.name for body in c.scene.bodies if not body.rigid]
    return all(
        time * impedance(c, name)[1] > CROSSINGS * np.ptp(c.model.X[c.nodes(name)], axis=0).max() for name in names
    )


def _driven_speed(c: Context) -> float:
    """Greatest speed of drives that move nodes [m/s]."""
    return max((max(map(abs, item.velocity_table[1])) for item in c.scene.prescribed), default=0.0)


def _wave_forces(c: Context, pair: Pair, time: float, driven: float = 0.0) -> tuple[float, float]:
    """Least and greatest force of a single wave by `time` [N], inf of rigid bodies and where none approach.

    The least is v A / (1 / Z_1 + 1 / Z_2) of the smaller area, with the speed of waves in bars; the greatest that of
    dilatational waves once they have spread, v / (1 / Z_1 A_1 + 1 / Z_2 A_2). With a `driven` speed [m/s] it counts in
    place of that at which bodies approach.
    """
    names, axis = pair
    means = [c.model.V[c.nodes(name)].mean(axis=0) for name in names]
    between = (means[0] - means[1] if len(means) > 1 else means[0]) + time * c.model.gravity[0]
    normal = axis if axis.any() else between / max(float(np.linalg.norm(between)), 1e-30)
    speed = driven or abs(float(between @ normal))
    soft = [name for name in names if not c.scene.body(name).rigid]
    if not soft or (not driven and speed <= STILL * float(np.linalg.norm(between))):
        return math.inf, math.inf
    area = {name: shadow(c, name, normal) for name in names}
    if not (smallest := min(area.values())):  # of a closed master that is driven from rest
        return 0.0, 0.0
    least = speed * smallest / sum(1.0 / impedance(c, name, "bar")[0] for name in soft)
    return least, speed / sum(1.0 / (impedance(c, name)[0] * area[name]) for name in soft)


def _return_time(c: Context, pair: Pair) -> float:
    """Time after which a wave is back from the far side of one of two bodies [s].

    Of a rigid body, which knows no waves, its shortest side counts: so wide they begin in the other one.
    """
    names, axis = pair
    speed = {
        name: min(material.wave_speeds["bar"] for material, _ in body_materials(c.scene.body(name), c.meshes[name]))
        for name in names
        if not c.scene.body(name).rigid
    }
    found = []
    for name in names:
        X = c.model.X[c.nodes(name)]
        sides = np.ptp(X, axis=0)
        if name not in speed:
            length = sides.min()
        else:
            length = np.ptp(X @ axis) if axis.any() else sides.max()
        found.append(2.0 * float(length) / speed.get(name, min(speed.values())))
    return min(found)
