"""Owns the guards that stop a run, and what they look at in its records."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.base.errors import GuardError
from warp_mca.watch.row import Array, Kind, Row, Values, When, row

if TYPE_CHECKING:
    from warp_mca.watch.ledger import Ledger


@dataclass(frozen=True, kw_only=True)
class Reading:
    """Records of a scene that are taken in together, up to the first that is broken.

    Attributes:
        ledger: that takes them in.
        flags: whether kernels saw a full list of faces, a node that outran the search, one that is too deep.
        time: that the next record would have [s].
        sums: columns of the latest record, shape (column_count,), float64, if it is not sound or its balance is off.
        balance: of the latter, imbalance [-], and initial energy and external work [J].
    """

    ledger: Ledger
    flags: Sequence[bool]
    time: float
    sums: Array | None = None
    balance: tuple[float, float] | None = None


flag = partial(row, kind=Kind.GUARD, when=When.FLAGS)
guard = partial(row, kind=Kind.GUARD, when=When.RECORDS)


@flag(
    "stopped before t = {time:.4g} s: contact lists overflowed: more than 32 faces near a node, or more nodes near a "
    "face than its list holds;",
    "mesh both sides more alike, or choose a smaller output_interval if they are fast",
    32.0,
    "faces of a node at most, and as many nodes of a face as its list holds",
)
def overflowed_list(c: Reading, _: float) -> Iterator[Values]:
    """Lists of faces near each slave node, and of slave nodes near each face."""
    return (dict(time=c.time) for raised in c.flags[:1] if raised)


@flag(
    "stopped before t = {time:.4g} s: a node outran the contact search;",
    "choose a smaller output_interval, or, where no body is so fast, penalty=10 and two_way=True, since springs were "
    "pressed deep, or other cells under the contact, since these have given way",
)
def outrun_search(c: Reading, _: float) -> Iterator[Values]:
    """Way of nodes since the latest search for contact, against that for which lists of faces hold."""
    return (dict(time=c.time) for raised in c.flags[1:2] if raised)


@flag(
    "stopped before t = {time:.4g} s: a node sank deeper than half a face into what it touches;",
    "raise penalty, refine the mesh, or, if penalty is high, lower time_step_scale",
    0.5,
    "of a face's width at most",
)
def sunken_node(c: Reading, _: float) -> Iterator[Values]:
    """Depth of slave nodes below the master."""
    return (dict(time=c.time) for raised in c.flags[2:3] if raised)


@guard(
    "energy imbalance {percent:.3g}% at t = {time:.4g} s exceeds energy_tolerance = {tolerance:g} of {scale:.3g} J, "
    "initial energy and external work so far{cause}:",
    "{remedy}, or raise the tolerance if that much is acceptable",
    unit="energy_tolerance at most, twice that where contact springs made it",
)
def energy_imbalance(c: Reading, _: float) -> Iterator[Values]:
    """Initial energy and external work, less all that is accounted for, over their sum."""
    if c.sums is not None and c.balance:
        ledger, (share, scale) = c.ledger, c.balance
        cause, remedy = ledger.cause(c.sums)
        yield dict(
            percent=100.0 * share, time=ledger.time(-1), tolerance=ledger.tolerance, scale=scale,
            cause=cause, remedy=remedy,
        )  # fmt: skip


@guard(
    "energy is not a number at t = 0, before the first step: speeds, sizes or moduli exceed the range of numbers;",
    "check their units{precision}",
)
def no_number_at_the_start(c: Reading, _: float) -> Iterator[Values]:
    """Whether energies, strains and volumes of the first record are finite numbers."""
    if _is_no_number(c) and not c.ledger.kept.records:
        yield dict(precision=", or choose float64" if c.ledger.precision == "mixed" else "")


@guard("energy is not a number at t = {time:.4g} s: the step was unstable;", "lower time_step_scale")
def no_number(c: Reading, _: float) -> Iterator[Values]:
    """The same of later records."""
    if _is_no_number(c):
        yield dict(time=c.time)


@guard("an element turned inside out before t = {time:.4g} s;", "refine the mesh or lower the load")
def inverted_element(c: Reading, _: float) -> Iterator[Values]:
    """Least ratio of an element's volume to that at the start, which must stay above 0."""
    if c.sums is not None and not c.balance:
        yield dict(time=c.time)


def stop(when: When, reading: Reading) -> None:
    """Look at the guards of a moment.

    Raises:
        GuardError: a guard is broken: the sentence of the first.
    """
    for item in GUARDS:
        if item.when is when:
            for sentence in item.told(reading):
                raise GuardError(sentence)


def _is_no_number(c: Reading) -> bool:
    return c.sums is not None and not c.balance and not np.isfinite(c.sums).all()


GUARDS = [item for item in vars().values() if isinstance(item, Row)]
