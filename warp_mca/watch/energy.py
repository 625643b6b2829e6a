"""Owns the rows about energy, and that of contact springs at the greatest force with what it does to the peak."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.kernels.records.columns import PRESSURE, SPRING_ENERGY
from warp_mca.physics.contact.surfaces import is_curved_contact
from warp_mca.physics.elements import ELEMENTS
from warp_mca.watch.ledger import MIN_EXCHANGE
from warp_mca.watch.row import Finished, Values, row

if TYPE_CHECKING:
    from warp_mca.model.model import Model
    from warp_mca.watch.ledger import Ledger

# Relative loss of the force peak over the share of the exchanged energy that springs hold then; measured on balls and
# links within a factor of 2, see docs/decisions.md.
PEAK_LOSS = 0.3


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
    "raise the contact's penalty{default}, or refine the mesh there",
    0.25,
    "of the exchanged energy at most",
)
def soft_springs(c: Finished, most: float) -> Iterator[Values]:
    """Energy in the springs of each contact when its force is greatest.

    Springs of flat ends are by default as soft as cells: waves that have reached few cells leave them a large share.
    """
    curved = {item.contact for item in c.model.passes if is_curved_contact(c.model.X, item)}
    for k, ((name, share), contact) in enumerate(zip(c.shares.items(), c.scene.contacts, strict=True)):
        if share is not None and share > most and (contact.penalty is not None or k in curved):
            default = "" if contact.penalty is None else " or leave it to its default"
            yield dict(share=share, name=name, loss=PEAK_LOSS * share, default=default)


@row(
    "{hourglass:.2g} J, {share:.1%} of the plastic work, went to internal vectors, which lag a step behind the flow:",
    "lower time_step_scale, with which it goes down, and compare",
    0.03,
    "of the plastic work at most",
)
def lagging_vectors(c: Finished, most: float) -> Iterator[Values]:
    """Energy that internal vectors of `hex8i`, `hex8w` or `wedge6` lost as they lagged, over the plastic work."""
    energy = c.ledger.energy()
    spent, plastic = energy["hourglass"], energy["plastic"]
    if spent > most * plastic > 0.0 and all(
        getattr(ELEMENTS[block.element], "lags", False) for block in c.model.blocks if block.plastic
    ):
        yield dict(hourglass=spent, share=spent / plastic)


def spring_shares(ledger: Ledger, model: Model, names: Sequence[str]) -> dict[str, float | None]:
    """Energy in the springs of each contact as a share of what the bodies have exchanged, when its force is greatest.

    What is exchanged is kinetic energy gained or lost since the start, or energy that is not kinetic, whichever is
    greater, as for `Ledger.exchange_error`. None where there is no force, or hardly anything was exchanged.

    Args:
        ledger: of the run; rows of its history count.
        model: of the scene alone.
        names: of its contacts.
    """
    springs, energy = ledger.springs(ledger.table()), ledger.energies()
    work, kinetic = energy.pop("external_work"), energy["kinetic"]
    stored = sum(energy.values(), np.zeros(len(work)))
    exchanged = np.maximum(np.abs(kinetic - kinetic[:1]), stored - kinetic)
    found: dict[str, float | None] = {}
    for k, name in enumerate(names):
        own = springs[:, [item.contact == k for item in model.passes]]
        force = own[..., PRESSURE].sum(axis=1)
        row = int(force.argmax()) if len(force) else 0
        met = len(force) > 0 and force[row] > 0.0 and exchanged[row] > MIN_EXCHANGE * ledger.kept.energy_scale
        found[name] = float(own[row, :, SPRING_ENERGY].sum() / exchanged[row]) if met else None
    return found


def peak_losses(shares: Mapping[str, float | None]) -> dict[str, float | None]:
    """Estimated relative error of the greatest force of each contact against that of stiff springs [-]."""
    return {name: None if share is None else -PEAK_LOSS * share for name, share in shares.items()}
