"""Owns the columns of a record behind those of contact passes, and the entries of the energy ledger they add to."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from warp_mca.kernels.records.columns import PASS, PASS_COLUMNS
from warp_mca.scene.loads import LOADS

if TYPE_CHECKING:
    from warp_mca.model.model import Model


FAILURE = "failure"  # entry of the ledger: elastic and hourglass energy that went with elements that failed


class Added(NamedTuple):
    """Columns of one actor: the first, and the entry of the ledger to which each of them adds."""

    first: int
    energies: tuple[str, ...]


def pass_count(model: Model) -> int:
    """Contact passes of each scene."""
    return len(model.passes) // (model.batch.count if model.batch else 1)


def added_columns(model: Model) -> dict[str, Added]:
    """Columns of each actor that adds some, by its name: loads, elements that may fail, absorbing boundaries.

    All scenes of a batch have the same kinds of loads, and elements that may fail or none; those without absorbing
    boundaries read fewer columns.
    """
    kinds = {kind: LOADS[kind].energies for kind in model.loads}
    kinds |= {FAILURE: (FAILURE,)} if model.fails else {}
    kinds |= {"absorbing": model.absorbing.ENERGIES} if len(model.absorbing.node) else {}
    found, first = {}, PASS + PASS_COLUMNS * pass_count(model)
    for name, energies in kinds.items():
        found[name] = Added(first, energies)
        first += len(energies)
    return found


def column_count(model: Model) -> int:
    """Columns of a record."""
    return PASS + PASS_COLUMNS * pass_count(model) + sum(len(own.energies) for own in added_columns(model).values())
