"""Owns what contact springs give away: their energy at the greatest force, and what that does to the peak."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.kernels.records.columns import PRESSURE, SPRING_ENERGY
from warp_mca.watch.ledger import MIN_EXCHANGE

if TYPE_CHECKING:
    from warp_mca.model.model import Model
    from warp_mca.scene import Contact
    from warp_mca.watch.ledger import Ledger

# Relative loss of the force peak over the share of the exchanged energy that springs hold then; measured on balls and
# links within a factor of 2, see docs/decisions.md.
PEAK_LOSS = 0.3
SOFT = 0.25  # share from which on springs are said to be soft


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


def soft_springs(shares: Mapping[str, float | None], contacts: Sequence[Contact]) -> Iterator[str]:
    """A sentence for each contact whose springs are soft beside its bodies."""
    for (name, share), contact in zip(shares.items(), contacts, strict=True):
        if share is not None and share > SOFT:
            default = "" if contact.penalty is None else " or leave it to its default"
            yield (
                f"contact springs held {share:.0%} of the energy that bodies had exchanged when the force of {name} "
                f"was greatest: its peak is some {PEAK_LOSS * share:.0%} below that of stiff springs, and later; raise "
                f"the contact's penalty{default}, or refine the mesh there"
            )
