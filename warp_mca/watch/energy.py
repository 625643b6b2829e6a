"""Owns the rows about energy, and that of contact springs at the greatest force with what it does to the peak."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.kernels.records.columns import PRESSURE, SPRING_ENERGY
from warp_mca.physics.elements import ELEMENTS
from warp_mca.scene import Bolt, Contact, ContactAll, Settle, ThermalStrain
from warp_mca.watch.ledger import MIN_EXCHANGE
from warp_mca.watch.row import Context, Finished, SpringShare, Values, row, sides_of
from warp_mca.watch.spring_loss import Peak, curved_contacts, loss_of_peak

if TYPE_CHECKING:
    from warp_mca.watch.ledger import Ledger

WEIGHT = 2.0  # times the weight of all bodies: a contact at rest of no more force bears it


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
    curved = curved_contacts(c.model)
    for k, ((name, springs), contact) in enumerate(zip(c.shares.items(), c.scene.contacts, strict=True)):
        if springs is not None and springs.loss > most and not springs.rest and not _given(contact):
            remedy = "raise the contact's penalty, or refine the mesh there"
            if springs.where == "edges":
                remedy = "give the contact penalty=10 and refine the mesh there until its peak no longer changes"
            elif contact.penalty is None and springs.where == "flat":  # stiffer ones ring there: 2 rho c A v with 10
                remedy = "give the contact penalty=2 and a time_step_scale at which its energy balance holds, "
                remedy += "or refine the mesh there"
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
    interference loads contacts at rest, all their springs and the bodies are in series: they lose s of its force.

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
        if row is not None:
            loss = float(energy["contact"][row] / series[row])
            found[name] = SpringShare(share=float(held[row] / series[row]), loss=loss, rest=True)
            continue
        peak = Peak(
            share=float(held[greatest] / exchanged[greatest]),
            plastic=float(energy["plastic"][greatest] / exchanged[greatest]),
            series=float(energy["contact"][greatest] / series[greatest]) if series[greatest] > 0.0 else 0.0,
            force=math.inf if pulled else float(force[greatest]),
            time=ledger.steps.interval * greatest,
            pressed=ledger.steps.interval * (greatest - int(np.argmax(force > 0.0)) + 1),
        )
        loss, where = loss_of_peak(c, k, depths, peak, ledger.time())
        found[name] = SpringShare(share=peak.share, loss=loss, where=where)
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
