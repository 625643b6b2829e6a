"""Owns the watch for bodies that go through each other, through a plane or through themselves, and what it says.

A look takes the boxes of all bodies. Where two meet, edges of one skin are followed through the faces of the other
(`skins.py`): skins of bodies that overlap cross, whatever their cells. How far anything can have moved since the last
look decides when the next one is due, so that nothing passes the thinnest part of a body in between.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from types import MappingProxyType

import numpy as np

from warp_mca.base.arrays import Index
from warp_mca.geometry.mesh import Mesh
from warp_mca.scene import Scene
from warp_mca.system.contact import ContactPass
from warp_mca.system.model import Model
from warp_mca.watch.passing_cases import DEEP, SLACK, BelowPlane, Case, Look, WithinBody, WithinItself, cases_of
from warp_mca.watch.row import Array, Finished, Values, When, row
from warp_mca.watch.skins import Skin

MEANT = 1.25  # times the overlap at the start, up to which it is meant
FEWEST = 6  # looks in an impact phase at least
CLOSEST = 4  # steps between two looks at least: in so few nothing passes two cells below half of the wave speed
FASTER = 1.5  # times the greatest speed so far that nodes may reach until the next look

DEPTH, TIME, PLACE, START = 0, 1, slice(2, 5), 5  # columns of `SceneRecords.passed`


class Watch:
    """What is looked at in one scene.

    Attributes:
        nodes: of the skins, those of each in turn, in the model's numbering, int32; empty where there is no case.
    """

    def __init__(
        self,
        scene: Scene,
        meshes: Mapping[str, Mesh],
        model: Model,
        dt: float,
        span: float,
        skins: Sequence[Skin] = (),
        nodes: Index | None = None,
    ) -> None:
        """Choose what to look at in an impact phase of `span` [s] with steps of `dt` [s].

        Args:
            scene, meshes, model: what moves.
            dt, span: as above.
            skins: as `skins_of`; made where they are empty.
            nodes: as a helper has them that looks in place of this; skins are made if it is lost.
        """
        self.take_steps(dt, span)
        self._driven = float(np.abs(model.table_value).max(initial=0.0))
        self._gravity = float(np.linalg.norm(scene.gravity))
        self._of = scene, meshes, model
        self._cases: list[Case] | None = None
        if nodes is None:
            self._take(skins or skins_of(scene, meshes, model), model.passes)
        else:
            self.nodes = nodes

    def take_steps(self, dt: float, span: float) -> None:
        """Look often enough in an impact phase of `span` [s] with steps of `dt` [s]."""
        self._dt, self._most = dt, max(1, int(span / FEWEST / dt))

    @property
    def cases(self) -> list[Case]:
        """What can go into each other."""
        if self._cases is None:
            self._take(skins_of(*self._of), self._of[2].passes)
        assert self._cases is not None
        return self._cases

    def renew(self, faces: Mapping[str, Index], passes: tuple[ContactPass, ...], passed: Array) -> Array:
        """Look at other surfaces from now on.

        Args:
            faces: of skins, by body in the numbering of its mesh; others are whole.
            passes: of contact, as surfaces are now.
            passed: what was seen before, as `SceneRecords.passed`.

        Returns:
            The same of the cases that there are now.
        """
        before = [case.key for case in self.cases]
        self._take(skins_of(*self._of, faces), passes)
        if not len(passed):
            return passed
        found = np.zeros((len(self.cases), passed.shape[1]))
        for kept, case in zip(found, self.cases, strict=True):
            if case.key in before:
                kept[:] = passed[before.index(case.key)]
        return found

    def _take(self, skins: Sequence[Skin], passes: tuple[ContactPass, ...]) -> None:
        scene, meshes, model = self._of
        model, self._skins = replace(model, passes=passes), skins
        self._cases = list(cases_of(scene, meshes, model, self._skins))
        nodes = np.concatenate([np.zeros(0, np.int32), *(skin.nodes for skin in self._skins)])
        self.nodes = nodes[: None if self._cases else 0]

    def look(self, x: Array, speed: float, pressed: Array, time: float, passed: Array) -> tuple[Array, int]:
        """What has been seen, with bodies as they are now, and how many steps may pass between two looks.

        Args:
            x: positions of `nodes` [m], shape (node_count, 3), float64.
            speed: greatest of any node so far [m/s].
            pressed: greatest depth of springs of each contact pass so far [m], shape (pass_count,), float64.
            time: [s].
            passed: what was seen before, as `SceneRecords.passed`; empty at the first look.
        """
        if not np.isfinite(x).all():
            return passed, self._most
        cases = self.cases  # with the skins
        first = np.cumsum([len(skin.nodes) for skin in self._skins])[:-1]
        for skin, own in zip(self._skins, np.split(x, first), strict=True):
            skin.move(own)
        look = Look(self._skins)
        passed = passed.copy() if len(passed) else self._start(look)
        for case, kept in zip(cases, passed, strict=True):
            allowed = case.allowed(pressed)
            depth, at = case.found(look, allowed)
            if depth > allowed + MEANT * kept[START]:
                kept[TIME] = kept[TIME] if kept[DEPTH] else time
                if depth > kept[DEPTH]:
                    kept[DEPTH], kept[PLACE] = depth, at
        return passed, self._steps(min(case.room(look) for case in cases), speed)

    def _start(self, look: Look) -> Array:
        """Rows with the overlap at the start."""
        rows = np.zeros((len(self.cases), START + 1))
        for case, kept in zip(self.cases, rows, strict=True):
            kept[START] = case.found(look, 0.0)[0]
            if isinstance(case, WithinBody) and not kept[START] and case.holds(look):
                kept[START] = np.inf
        return rows

    def _steps(self, room: float, speed: float) -> int:
        """Steps until a look, before two nodes have approached by `room` [m]: 2 (v t + g t^2 / 2) at most."""
        v, g = FASTER * speed + self._driven, self._gravity
        fastest = v + math.sqrt(v * v + g * room)
        steps = room / fastest / self._dt if 0.0 < fastest < math.inf else math.inf
        return int(max(CLOSEST, min(self._most, steps)))


def skins_of(
    scene: Scene, meshes: Mapping[str, Mesh], model: Model, faces: Mapping[str, Index] = MappingProxyType({})
) -> list[Skin]:
    """The skins of a scene's bodies, in their order; `faces` by body where they are not whole, as in `Watch.renew`."""
    return [
        Skin(b.name, faces.get(b.name, meshes[b.name].boundary[0]), model.X, model.node_start[b.name])
        for b in scene.bodies
        if not b.is_inertia
    ]


looked = partial(
    row,
    unit=f"as deep at most as springs, flat faces and an overlap at the start explain, or {DEEP:g} of the thinner body",
    when=When.LOOKS,
)


@looked("nodes of {one} that are not in its contact's surface went below the rigid plane {seen}:", "{remedy}")
def below_a_plane(c: Finished, _: float) -> Iterator[Values]:
    """Depth of nodes below a rigid plane that others of their body are in contact with."""
    return _seen(c, BelowPlane)


@looked("{one} and {other} went into each other {seen}:", "{remedy}")
def bodies_in_each_other(c: Finished, _: float) -> Iterator[Values]:
    """How deep skins of two bodies cross."""
    return _seen(c, WithinBody)


@looked("parts of {one} went through each other {seen}:", "{remedy}")
def body_in_itself(c: Finished, _: float) -> Iterator[Values]:
    """How deep the skin of a body crosses itself."""
    return _seen(c, WithinItself)


@row(
    "{one} and {other} overlap at the start, {how}, and no contact, joint or tie is between them: their masses "
    "count twice there, and nothing keeps them apart;",
    "move them apart, or bind them",
    unit=f"as deep at most as flat faces explain, {SLACK:g} of the wider ones and of the thinner body",
    when=When.LOOKS,
)
def overlap_at_the_start(c: Finished, _: float) -> Iterator[Values]:
    """How deep skins of two bodies cross before the first step."""
    for case, kept in zip(c.watch.cases, c.ledger.kept.passed, strict=False):
        if isinstance(case, WithinBody) and not (case.passes or case.edges) and kept[START] > case.slack:
            one, other = (skin.name for skin in case.skins)
            how = f"up to {kept[START]:.2g} m deep" if kept[START] < math.inf else "one of them within the other"
            yield dict(one=one, other=other, how=how)


def _seen(c: Finished, kind: type[Case]) -> Iterator[Values]:
    """Cases of a kind that were seen, by their bodies, with time, depth and place."""
    for case, told in zip(c.watch.cases, c.ledger.kept.passed, strict=False):
        if isinstance(case, kind) and told[DEPTH]:
            digits = 1 - math.floor(math.log10(told[DEPTH]))  # place to a tenth of the depth or finer
            at = ", ".join(f"{round(x, digits) + 0.0:g}" for x in told[PLACE].tolist())
            seen = f"from t = {told[TIME] - c.origin:.3g} s on, up to {told[DEPTH]:.2g} m deep at ({at}) m"
            one, *other = (skin.name for skin in case.skins)
            yield dict(one=one, other="".join(other), seen=seen, remedy=case.remedy)
