"""Owns the scenes of a batch that a helper holds: it looks at them, and says what they say, without being sent them."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from warp_mca.base.arrays import Array, Index
from warp_mca.base.helpers import Helper, LostError
from warp_mca.base.kept import unchanged
from warp_mca.watch.bending import samples_of, seen
from warp_mca.watch.bent_scenes import Together
from warp_mca.watch.passing import Watch
from warp_mca.watch.row import Context, Finished
from warp_mca.watch.table import told_at_the_end

if TYPE_CHECKING:
    from warp_mca.rigid.handoff import HandOff

MOST_CELLS = 20_000  # of a scene that is held: others take memory twice, and are sent where they are needed


@dataclass(frozen=True)
class Home:
    """Where a scene is held.

    Attributes:
        number: under which its helper has it.
        nodes: of its skins, as `Watch.nodes`, shape (node_count,), int32.
        helper: that holds it; None on the way from there.
    """

    number: int
    nodes: Index
    helper: Helper | None = None


class Seen(NamedTuple):
    """What a helper is told of a scene for a look at its skins; as arguments of `Watch.look`, but displacements u."""

    u: Array
    speed: float
    pressed: Array
    time: float
    passed: Array


@dataclass
class _Held:
    context: Context
    start: HandOff
    watch: Watch

    @cached_property
    def together(self) -> Together:
        return Together([(self.context.model, samples_of(self.context.model))])


_HELD: dict[int, _Held] = {}  # of this process, a helper
_BATCH: list[int] = []


def hold(batch: int, number: int, context: Context, start: HandOff) -> Home:
    """Hold a scene, and no longer those of other batches."""
    if [batch] != _BATCH:
        _HELD.clear()
        _BATCH[:] = [batch]
    with unchanged():
        watch = Watch(context.scene, context.meshes, context.model, 1.0, 1.0)  # its steps are told with each look
    _HELD[number] = _Held(context, start, watch)
    return Home(number, watch.nodes)


def look_at_bending(asked: Sequence[tuple[int, Array, Array]]) -> list[Array]:
    """`SceneRecords.stiffened` of scenes by their numbers, of displacements [m] and what was seen before."""
    return [_HELD[number].together.seen(u, [before])[0] for number, u, before in asked]


def look_at_skins(dt: float, span: float, asked: Sequence[tuple[int, Seen]]) -> list[tuple[Array, int]]:
    """What `Watch.look` says of scenes by their numbers, in a phase of `span` [s] with steps of `dt` [s]."""
    found = []
    for number, own in asked:
        held = _HELD[number]
        held.watch.take_steps(dt, span)
        x = held.context.model.X[held.watch.nodes] + own.u
        found.append(held.watch.look(x, own.speed, own.pressed, own.time, own.passed))
    return found


def tell(asked: Sequence[tuple[int, Finished, Sequence[str]]]) -> list[tuple[str, ...]]:
    """What scenes say of themselves by their numbers, of what `parted` leaves of them and what was told before."""
    return [_tell(_HELD.pop(number), own, before) for number, own, before in asked]


def _tell(held: _Held, own: Finished, before: Sequence[str]) -> tuple[str, ...]:
    context, kept = held.context, own.ledger.kept
    rows = {name: list(getattr(kept, name)) for name in ("sums", "velocities")}
    own.ledger.kept, own.ledger.model = replace(kept, **rows), context.model
    bent = own.bent if own.stopped else held.together.seen(own.u, [own.bent])[0]
    parts = {"scene": context.scene, "meshes": context.meshes, "model": context.model}
    with unchanged():
        return told_at_the_end(replace(own, **parts, start=held.start, watch=held.watch, bent=bent), before)


def parted(finished: Finished, *, at_home: bool = True) -> Finished:
    """A scene without the rows of which nothing is told, and without what its helper has `at_home`."""
    ledger = copy(finished.ledger)
    ledger.kept = replace(ledger.kept, path_stress=[], sensors=[])
    if not at_home:
        return replace(finished, ledger=ledger)
    rows: dict[str, Any] = {name: np.array(getattr(ledger.kept, name)) for name in ("sums", "velocities")}
    ledger.kept = replace(ledger.kept, **rows)  # as one array each: there are hundreds of rows
    del ledger.model
    return replace(finished, ledger=ledger, **dict.fromkeys(("scene", "meshes", "model", "start", "watch")))


def looked_at(finished: Finished) -> Finished:
    """A scene that was held, with the last look at its bending by this process."""
    if finished.stopped:
        return finished
    return replace(finished, bent=seen(finished.model, samples_of(finished.model), finished.u, finished.bent))


class Question:
    """What helpers were asked of the scenes that they hold; they compute while this process goes on."""

    def __init__(self, function: Any, homes: Sequence[Home], asked: Sequence[tuple[Any, ...]], *more: Any) -> None:
        """Ask each helper once: `function` gets `more`, then number and what is `asked` of each scene."""
        self._count = len(homes)
        by: dict[Helper, list[int]] = {}
        for k, home in enumerate(homes):
            if home.helper:
                by.setdefault(home.helper, []).append(k)
        self._sent: list[tuple[Helper, int, list[int]]] = []
        for helper, own in by.items():
            try:
                number = helper.ask(function, *more, [(homes[k].number, *asked[k]) for k in own])
            except LostError:
                continue
            self._sent.append((helper, number, own))

    def answers(self) -> list[Any]:
        """Of each scene; None where its helper ended."""
        found: list[Any] = [None] * self._count
        for helper, number, own in self._sent:
            try:
                answers = helper.told(number)
            except LostError:
                continue
            for k, answer in zip(own, answers, strict=True):
                found[k] = answer
        return found
