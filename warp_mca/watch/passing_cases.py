"""Owns what can go into each other in a scene: bodies, parts of a body, nodes below a plane."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array, Index
from warp_mca.geometry.mesh import Mesh
from warp_mca.scene import RigidPlane, Scene
from warp_mca.system.model import Model
from warp_mca.watch.row import listed_passes
from warp_mca.watch.skins import NOWHERE, Found, Skin, crossed

Mask = NDArray[np.bool_]

SLACK = 0.05  # of the wider faces, and of the thinner body, by which skins may cross: their faces are flat
PRESSED = 2.0  # times the depth of a contact's springs, up to which skins cross by the contact's own doing
DEEP = 0.1  # of the thinner body, by which skins may cross that contact keeps apart, as by its springs alone
SHARE = 0.5  # of the thinnest part of two bodies that they move on between two looks at most
BEND = 0.25  # of the gap between parts of a body that its nodes move out of shape before it is looked at
SLENDER = 8.0  # lengths over thickness from which on a body without gaps may meet itself
ROOM = 1.5  # times the reach of the place where bound bodies meet at the start: there they may overlap

BELOW = "no contact keeps them out there; take all of the surface, such as nodes='boundary', in a Contact"
APART = (
    "no contact keeps them out there; take contacts='all', or all of the surface, such as nodes='boundary', in a "
    "Contact"
)
PARTS = "no contact keeps them apart; take contacts='all', or a ContactAll beside the contacts that are listed"
BETWEEN = (
    "contact springs are pressed so deep, or nodes of a master pass between those of a coarser slave; give a listed "
    "contact penalty=10 and two_way=True, or let nodes lie closer where the bodies meet"
)


class Look:
    """Skins as they are now.

    Attributes:
        boxes: least and greatest coordinates of each skin [m], shape (body_count, 2, 3), float64.
        origin: a point amid the bodies [m], shape (3,), float64.
    """

    def __init__(self, skins: Sequence[Skin]) -> None:
        self._skins = skins
        self.boxes = np.array([skin.box for skin in skins])
        self.origin = self.boxes.mean(axis=(0, 1))
        self._bent: dict[int, float] = {}

    @cached_property
    def gaps(self) -> Array:
        """Between the boxes of two skins, along the axis where it is greatest; negative where they meet [m].

        Shape (body_count, body_count), float64.
        """
        lower, upper = self.boxes[:, 0], self.boxes[:, 1]
        apart = (lower[:, None] - upper).max(axis=2)
        return np.maximum(apart, apart.T)

    def bent(self, number: int) -> float:
        """How far a skin is out of shape [m]."""
        if number not in self._bent:
            self._bent[number] = self._skins[number].bent()
        return self._bent[number]


@dataclass(frozen=True)
class Case:
    """What may go into each other.

    Attributes:
        skins: of one body or two.
        passes: contact passes that keep them apart.
        remedies: without such passes, and with them.
    """

    skins: tuple[Skin, ...]
    passes: tuple[int, ...]
    remedies: ClassVar[tuple[str, str]] = APART, BETWEEN

    @property
    def slack(self) -> float:
        """How deep they may lie in each other [m]."""
        return SLACK * min(max(skin.width for skin in self.skins), self.thickness)

    @property
    def thickness(self) -> float:
        """Of the thinner one [m]."""
        return min(skin.thickness for skin in self.skins)

    def allowed(self, pressed: Array) -> float:
        """How deep they may lie in each other where springs of passes were so deep, shape (pass_count,) [m]."""
        own = [float(pressed[k]) for k in self.passes]
        return max(self.slack + PRESSED * max(own), DEEP * self.thickness) if own else self.slack

    @property
    def key(self) -> tuple[str, ...]:
        """What tells it from others of a scene."""
        return type(self).__name__, *(skin.name for skin in self.skins), *map(str, self.passes)

    @property
    def remedy(self) -> str:
        """What helps."""
        return self.remedies[bool(self.passes)]

    def found(self, look: Look, least: float) -> Found:
        """Where they lie deepest in each other, if deeper than `least` [m]."""
        raise NotImplementedError

    def room(self, look: Look) -> float:
        """How far nodes can approach each other before they are through [m]."""
        raise NotImplementedError


@dataclass(frozen=True)
class BelowPlane(Case):
    """Nodes of a body's surface that no contact keeps above a plane that others of its nodes are in contact with."""

    kept_out: Mask
    plane: RigidPlane
    remedies = BELOW, BELOW

    def allowed(self, pressed: Array) -> float:
        """How deep nodes that no spring holds may lie below the plane [m]: as springs of others, and flat faces."""
        return self.slack + PRESSED * max((float(pressed[k]) for k in self.passes), default=0.0)

    def found(self, look: Look, least: float) -> Found:
        """The deepest node below the plane, if it is deeper than `least` [m]."""
        (skin,) = self.skins
        normal = np.asarray(self.plane.normal, dtype=float)
        height = (skin.x - self.plane.point) @ normal / np.linalg.norm(normal)
        depth = -np.where(self.kept_out, np.inf, height)
        best = int(depth.argmax())
        return (float(depth[best]), skin.x[best]) if depth[best] > least else NOWHERE

    def room(self, look: Look) -> float:
        """How far nodes can move before a look is due [m]: none comes out of a plane on its other side."""
        return SHARE * float(self.skins[0].extents[2])


@dataclass(frozen=True)
class WithinBody(Case):
    """Two bodies, by their numbers among the skins; `edges` of each count, as in `crossed`."""

    numbers: tuple[int, int]
    edges: tuple[Mask, Mask] | None

    def found(self, look: Look, least: float) -> Found:
        """Where they lie deepest in each other, if edges lie deeper than `least` [m] behind faces."""
        if look.gaps[self.numbers] > 0.0:
            return NOWHERE
        one, other = self.skins
        a, b = (look.boxes[k] for k in self.numbers)
        return crossed(one, other, (a, b), look.origin, least, self.edges)

    def room(self, look: Look) -> float:
        """How far they can approach each other before they are through [m]."""
        return max(SHARE * min(skin.thickness for skin in self.skins), 0.5 * look.gaps[self.numbers])

    def holds(self, look: Look) -> bool:
        """Whether one lies in the other as a whole, given that their skins do not cross."""
        one, other = zip(self.skins, (look.boxes[k] for k in self.numbers), strict=True)
        for (inner, own), (outer, around) in ((one, other), (other, one)):
            if (own[0] > around[0]).all() and (own[1] < around[1]).all():
                return outer.deepest(inner.x[:1])[0] > 0.0
        return False


@dataclass(frozen=True)
class WithinItself(Case):
    """A body, by its number, whose parts can meet once it is out of shape by more than `play` [m]."""

    number: int
    play: float
    remedies = PARTS, BETWEEN

    def found(self, look: Look, least: float) -> Found:
        """Where its parts lie deepest in each other, if edges lie deeper than `least` [m] behind faces."""
        if look.bent(self.number) < self.play:
            return NOWHERE
        return self.skins[0].crossed_by_itself(look.boxes[self.number], look.origin, least)

    def room(self, look: Look) -> float:
        """How far parts can approach each other before they are through [m]."""
        return max(SHARE * self.skins[0].thickness, 0.5 * (self.play - look.bent(self.number)))


def cases_of(scene: Scene, meshes: Mapping[str, Mesh], model: Model, skins: Sequence[Skin]) -> Iterator[Case]:
    """What can go into each other of a scene's model, `skins` being those of its bodies."""
    number = {skin.name: k for k, skin in enumerate(skins)}
    passes: dict[frozenset[str], tuple[int, ...]] = {}
    planes: dict[tuple[str, RigidPlane], tuple[int, ...]] = {}
    for k, _, contact in listed_passes(scene, model):
        slave, master = contact.slave.body, contact.master
        if isinstance(master, RigidPlane):
            planes[slave, master] = (*planes.get((slave, master), ()), k)
        else:
            names = frozenset((slave, master.body))
            passes[names] = (*passes.get(names, ()), k)
    general = tuple(k for k, item in enumerate(model.passes) if item.pairs)
    passes |= {frozenset(pair): general for pair in scene.general_pairs()}
    for (name, plane), own in planes.items():
        skin = skins[number[name]]
        kept_out = np.isin(skin.nodes, np.concatenate([model.passes[k].slave for k in own]))
        if not kept_out.all():
            yield BelowPlane((skin,), own, kept_out, plane)
    bound = _bound_nodes(scene, meshes, model)
    whole = {frozenset((joint.body, joint.other)) for joint in scene.acting_joints if joint.whole()}
    links = frozenset().union(*whole) | {item.body for item in scene.fixed}
    given = {body.name for body in scene.bodies if body.mass is not None}
    for numbers in combinations(range(len(skins)), 2):
        one, other = (skins[k] for k in numbers)
        names = frozenset((one.name, other.name))
        # links overlap at their joint, and elsewhere if one's mass is not that of its shape and no contact is asked for
        if names in whole or (names <= links and names & given and names not in passes):
            continue
        edges = _free_edges(one, other, [model.X[nodes] for nodes in bound.get(names, ())])
        yield WithinBody((one, other), passes.get(names, ()), numbers, edges)
    for k, skin in enumerate(skins):
        long = skin.extents[2] if skin.extents[2] > SLENDER * skin.extents[0] else np.inf
        play = BEND * min(skin.gap, long)
        if not scene.body(skin.name).rigid and np.isfinite(play):
            yield WithinItself((skin,), passes.get(frozenset((skin.name,)), ()), k, play)


def _bound_nodes(scene: Scene, meshes: Mapping[str, Mesh], model: Model) -> dict[frozenset[str], list[Index]]:
    """Nodes that each joint or tie between two bodies binds, in the model's numbering, by the bodies' names."""
    found: dict[frozenset[str], list[Index]] = {}
    for joint, pairs in zip(scene.acting_joints, model.joints, strict=True):
        if joint.other is not None:
            nodes = np.concatenate([at[pairs.start : pairs.end] for at in (model.joint_first, model.joint_second)])
            found.setdefault(frozenset((joint.body, joint.other)), []).append(nodes[nodes >= 0])
    for tie in scene.ties:
        ends = ((side.body, model.node_start[side.body]) for side in (tie.slave, tie.master))
        own = [np.arange(start, start + len(meshes[name].points)) for name, start in ends]
        nodes = model.ties.slave[np.isin(model.ties.slave, own[0])]
        found.setdefault(frozenset((tie.slave.body, tie.master.body)), []).append(nodes)
    return found


def _free_edges(one: Skin, other: Skin, bound: Sequence[Array]) -> tuple[Mask, Mask] | None:
    """Edges of two skins off the places where joints and ties hold the bodies: hinges overlap there when they turn.

    Such a place reaches as far from the bound nodes as the bodies lie at each other there at the start, and half as far
    again. `bound` are positions of these nodes [m], each shape (count, 3); without any all edges are free, None.
    """
    from scipy.spatial import KDTree

    if not bound:
        return None
    free = [np.ones(len(skin.edge), dtype=bool) for skin in (one, other)]
    trees = [KDTree(skin.X) for skin in (one, other)]
    near = 0.75 * (one.width + other.width)
    for held in bound:
        for k, skin in enumerate((one, other)):
            meets = trees[1 - k].query(skin.X, distance_upper_bound=near)[0] < np.inf
            away = np.asarray(KDTree(held).query(skin.X)[0])
            reach = ROOM * float(away[meets].max(initial=skin.width))
            free[k] &= (away > reach)[skin.edge].all(axis=1)
    return free[0], free[1]
