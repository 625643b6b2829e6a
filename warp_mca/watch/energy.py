"""Owns the rows about energy, and that of contact springs at the greatest force with what it does to the peak."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.kernels.records.columns import PRESSURE, SPRING_ENERGY
from warp_mca.physics.contact.sides import face_geometry
from warp_mca.physics.elements import ELEMENTS
from warp_mca.scene import Bolt, Contact, ContactAll, Settle, ThermalStrain
from warp_mca.watch.contacts import on_edges
from warp_mca.watch.ledger import MIN_EXCHANGE
from warp_mca.watch.row import Context, Finished, SpringShare, Values, row, sides_of
from warp_mca.watch.vibration import impedance, shadow

if TYPE_CHECKING:
    from warp_mca.system.model import Model
    from warp_mca.watch.ledger import Ledger

# Relative loss of the force peak of a curved contact, or of one on edges, over the share of the exchanged energy that
# springs hold then; measured on balls, links and edges within a factor of 2, see docs/decisions.md.
PEAK_LOSS = 0.3
# Force of a flat contact over that of one wave up to which it may be that wave: with default springs, and with others,
# such as those of curved skins that land on a flat end, which may ring at 3.4 times that force.
WAVE = (1.3, 4.0)
CROSSINGS = 4.0  # of a body by waves, after which a drive presses it as slowly as no wave tells
STILL = 1e-6  # share of a relative velocity along the normal up to which bodies do not approach each other
WEIGHT = 2.0  # times the weight of all bodies: a contact at rest of no more force bears it
_LANDED, _ALIKE = 0.95, 1e-3  # least share of the shadow of a body that lands flat, most difference of its speeds [-]
_THIN = 0.5  # greatest height of a body over the root of its shadow: taller ones widen as bars do, and press less
_PLASTIC = 0.03  # of the exchanged energy: more plastic work limits the force
WEAK = 0.7  # force of a flat contact over that of one wave below which springs that were given are softer than waves


@row(
    "energy imbalance is {imbalance:.3g} J: {share:.3g} of the {exchanged:.3g} J that the bodies exchanged, {all:.2g} "
    "of all that they have, where energy_tolerance is {tolerance:g}:",
    "{remedy}, or take what they exchange as no more exact than that",
    unit="energy_tolerance at most",
)
def imbalance_of_exchange(c: Finished, _: float) -> Iterator[Values]:
    """Greatest imbalance over the energy that bodies exchanged, if that over all energy is within the tolerance."""
    ledger, kept, tolerance = c.ledger, c.ledger.kept, c.scene.impact.energy_tolerance
    if ledger.exchanges and ledger.exchange_error > tolerance >= kept.energy_error:
        yield dict(
            imbalance=kept.imbalance, share=ledger.exchange_error, exchanged=kept.exchanged, all=kept.energy_error,
            tolerance=tolerance, remedy=ledger.remedy,
        )  # fmt: skip


@row(
    "nodes that a master pressed went over to a face of it around a sharp edge, where single nodes do not tell which "
    "side is meant:",
    "make a contact of each of its sides, or finer meshes, and compare",
)
def turned_edge(c: Finished, _: float) -> Iterator[Values]:
    """Whether kernels saw a pressed node go over a sharp edge."""
    if c.ledger.kept.turned:
        yield {}


@row(
    "contact springs held {share:.0%} of the energy that bodies had exchanged when the force of {name} was greatest: "
    "its peak is some {loss:.0%} below that of stiff springs, and later;",
    "{remedy}",
    0.03,
    "of the force peak at most",
)
def soft_springs(c: Finished, most: float) -> Iterator[Values]:
    """Estimated loss of each contact's force peak by the energy in its springs then, see `spring_shares`."""
    curved = _curved(c.model)
    for k, ((name, springs), contact) in enumerate(zip(c.shares.items(), c.scene.contacts, strict=True)):
        if springs is not None and springs.loss > most and not springs.rest and not _given(contact):
            remedy = "raise the contact's penalty, or refine the mesh there"
            if springs.edges:
                remedy = "give the contact penalty=10 and refine the mesh there until its peak no longer changes"
            elif contact.penalty is None and k not in curved:
                remedy = "give the contact penalty=10, or refine the mesh there"
            elif contact.penalty is not None and k in curved:
                remedy = "raise the contact's penalty or leave it to its default, or refine the mesh there"
            yield dict(share=springs.share, name=name, loss=springs.loss, remedy=remedy)


@row(
    "contact springs take up {loss:.0%} of the interference that holds {name} at rest, and its force is that much "
    "below that of stiff springs:",
    "give the contact penalty={penalty:.2g} and a time_step_scale at which its energy balance holds, or refine the "
    "bodies along its normal",
    0.03,
    "of the force at most",
)
def soft_preload(c: Finished, most: float) -> Iterator[Values]:
    """Loss of force of each contact that an interference loads at rest, see `spring_shares`."""
    for (name, springs), contact in zip(c.shares.items(), c.scene.contacts, strict=True):
        if springs is not None and springs.rest and springs.loss > most and not _given(contact):
            given = contact.penalty if isinstance(contact, Contact) else None
            penalty = 10.0 if given is None or isinstance(given, str) else 10.0 * given
            yield dict(loss=springs.loss, name=name, penalty=penalty)


@row(
    "{hourglass:.2g} J, {share:.1%} of the plastic work, went to internal vectors, which lag a step behind the flow:",
    "lower time_step_scale, with which it goes down, and compare",
    0.03,
    "of the plastic work at most, and of the strain energy",
)
def lagging_vectors(c: Finished, most: float) -> Iterator[Values]:
    """Energy that internal vectors of `hex8i`, `hex8w` or `wedge6` lost as they lagged, over the plastic work."""
    energy = c.ledger.energy()
    spent, plastic = energy["hourglass"], energy["plastic"]
    if (
        plastic > 0.0
        and spent > most * max(plastic, energy["elastic"])
        and all(getattr(ELEMENTS[block.element], "lags", False) for block in c.model.blocks if block.plastic)
    ):
        yield dict(hourglass=spent, share=spent / plastic)


def spring_shares(
    c: Context, ledger: Ledger, names: Sequence[str], depths: Sequence[Array]
) -> dict[str, SpringShare | None]:
    """Energy in the springs of each contact as a share s of what the bodies have exchanged, when its force is greatest.

    What is exchanged is kinetic energy gained or lost since the start, or energy that is not kinetic, whichever is
    greater, as for `Ledger.exchange_error`. None where there is no force, or hardly anything was exchanged. Where an
    interference loads contacts at rest, all their springs and the bodies are in series: they lose s of its force. What
    lands flat on a plane loses what its force lacks of that of a wave.

    Args:
        c: scene, meshes and model.
        ledger: of the run; rows of its history count.
        names: of the scene's contacts.
        depths: of each contact pass, largest penetration of each spring [m], shape (spring_count,), float64.
    """
    springs, energy = ledger.springs(ledger.table()), ledger.energies()
    work, kinetic = energy.pop("external_work"), energy["kinetic"]
    stored = sum(energy.values(), np.zeros(len(work)))
    exchanged = np.maximum(np.abs(kinetic - kinetic[:1]), stored - kinetic)
    series = energy["contact"] + energy["elastic"]  # what an interference stores in springs and bodies
    found: dict[str, SpringShare | None] = dict.fromkeys(names)
    curved = _curved(c.model)
    for k, name in enumerate(names):
        own = springs[:, [item.contact == k for item in c.model.passes]]
        force, held = own[..., PRESSURE].sum(axis=1), own[..., SPRING_ENERGY].sum(axis=1)
        contact = c.scene.contacts[k]
        pulled = not force.any() and isinstance(contact, Contact) and contact.bond is not None
        if pulled:
            force = np.maximum(held, 0.0)  # in proportion to its square
        greatest = int(force.argmax()) if len(force) else 0
        if not len(force) or force[greatest] <= 0.0 or exchanged[greatest] <= MIN_EXCHANGE * ledger.kept.energy_scale:
            continue
        row = _row_at_rest(c, k, force, greatest)
        if row is None:
            share = float(held[greatest] / exchanged[greatest])
            lands = _lands_flat(c, k, depths)  # as a round bar does with its end, though its skin is curved
            flat = contact if isinstance(contact, Contact) and (lands or k not in curved) else None
            edges, loss, landed = flat is not None and on_edges(c, k, depths), PEAK_LOSS * share, None
            if flat is not None and lands and energy["plastic"][greatest] <= _PLASTIC * exchanged[greatest]:
                landed = _loss_of_landing(c, k, flat, float(force[greatest]))
            if landed is not None:
                loss = landed
            elif flat is not None and not edges:
                in_series = float(energy["contact"][greatest] / series[greatest]) if series[greatest] > 0.0 else 0.0
                greatest_force = math.inf if pulled else float(force[greatest])
                loss = _loss_of_flat(c, k, flat, share, in_series, greatest_force, ledger.time())
            elif isinstance(contact, ContactAll) and k not in curved and _is_pressed_slowly(c, greatest):
                loss = float(energy["contact"][greatest] / series[greatest])
            found[name] = SpringShare(share=share, loss=loss, edges=edges)
        else:
            loss = float(energy["contact"][row] / series[row])
            found[name] = SpringShare(share=float(held[row] / series[row]), loss=loss, rest=True)
    return found


def _given(contact: Contact | ContactAll) -> bool:
    """Whether a scene says how stiff each spring of a contact is."""
    return isinstance(contact, Contact) and contact.stiffness is not None


def _row_at_rest(c: Context, k: int, force: Array, greatest: int) -> int | None:
    """Row at which an interference loads contact k of bodies at rest: a press fit, or heat. None if there is none.

    That of the greatest force [N], of shape (row_count,), or the first one after the bodies have settled. Bolts press
    bodies on each other with their own force, whatever springs take.
    """
    passes = [item for item in c.model.passes if item.contact == k]
    heated = any(isinstance(load, ThermalStrain) for load in c.scene.loads)
    if not heated and all(item.initial_overlap != "press" for item in passes):
        return None
    contact = c.scene.contacts[k]
    sides = set(sides_of(contact)) if isinstance(contact, Contact) else None
    if any({load.body, load.other} == sides for load in c.scene.loads if isinstance(load, Bolt)):
        return None
    if any(c.model.V[item.slave].any() or c.model.V[item.master].any() for item in passes):
        return None
    row = 0 if any(isinstance(phase, Settle) for phase in c.scene.phases) else greatest
    weight = float(np.linalg.norm(c.scene.gravity)) * float(c.model.mass.sum())
    return row if force[row] > WEIGHT * weight else None


def _curved(model: Model) -> set[int]:
    """Contacts of curved surfaces."""
    return {item.contact for item in model.passes if item.curved}


def _loss_of_flat(
    c: Context, k: int, contact: Contact, share: float, in_series: float, force: float, time: float
) -> float:
    """Relative loss of the peak of a flat contact k whose springs held a share then.

    It is that of a mass on two springs in series, 1 - sqrt(1 - s), but none of the force of a single wave. Drives that
    press bodies on each other, or pull those that are bonded, lose all that springs take, `in_series`.
    """
    given, wave = contact.penalty is not None or k in _curved(c.model), _wave_force(c, k, contact, time)
    if (speed := _driven_speed(c)) and math.isinf(wave):
        return in_series if force > WAVE[True] * _wave_force(c, k, contact, time, speed) else 0.0
    if math.isinf(force):  # of a bond that is pulled
        return 0.0
    if force > WAVE[given] * wave:
        return 1.0 - math.sqrt(1.0 - min(share, 1.0))
    return PEAK_LOSS * share if given and force < WEAK * wave else 0.0


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


def _loss_of_landing(c: Context, k: int, contact: Contact, force: float) -> float | None:
    """Relative loss of the peak of contact k, of a thin body that does not yield and lands flat.

    At first it presses with Z v A, whatever is behind; springs that are softer than a thin wall do not come to that
    before waves are back. None of other bodies, and where more than a wave presses.
    """
    normal, body = c.model.contact_axes[k, 0], contact.slave.body
    wave, height = _wave_force(c, k, contact, 0.0), float(np.ptp(c.model.X[c.nodes(body)] @ normal))
    if math.isinf(wave) or force > WAVE[False] * wave or height > _THIN * math.sqrt(shadow(c, body, normal)):
        return None
    return max(0.0, 1.0 - force / wave)


def _is_pressed_slowly(c: Context, row: int) -> bool:
    """Whether drives press bodies on each other that were at rest, and waves crossed each of them before a row."""
    time = row * c.scene.impact.output_interval
    if c.model.V.any() or not _driven_speed(c):
        return False
    names = [body.name for body in c.scene.bodies if not body.rigid]
    return all(
        time * impedance(c, name)[1] > CROSSINGS * np.ptp(c.model.X[c.nodes(name)], axis=0).max() for name in names
    )


def _driven_speed(c: Context) -> float:
    """Greatest speed of drives that move nodes [m/s]."""
    return max((max(map(abs, item.velocity_table[1])) for item in c.scene.prescribed), default=0.0)


def _wave_force(c: Context, k: int, contact: Contact, time: float, driven: float = 0.0) -> float:
    """Force that a single wave gives in contact k by `time` [N]: Z v A, inf of rigid bodies and where none approach.

    With a `driven` speed [m/s] it counts in place of that at which bodies approach.
    """
    names, axis = sides_of(contact), c.model.contact_axes[k, 0]
    means = [c.model.V[c.nodes(name)].mean(axis=0) for name in names]
    between = (means[0] - means[1] if len(means) > 1 else means[0]) + time * c.model.gravity[0]
    normal = axis if axis.any() else between / max(float(np.linalg.norm(between)), 1e-30)
    speed = abs(float(between @ normal))
    if driven:
        speed = driven
    soft = [impedance(c, name)[0] for name in names if not c.scene.body(name).rigid]
    if not soft or (not driven and speed <= STILL * float(np.linalg.norm(between))):
        return math.inf
    return speed / sum(1.0 / Z for Z in soft) * min(shadow(c, name, normal) for name in names)
