"""Owns the contacts, ties and rigid walls of a deck."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import Any

import numpy as np

from warp_mca.decks.bodies import DeckBody
from warp_mca.decks.cards import Card, Content
from warp_mca.decks.places import Numbers, Places
from warp_mca.geometry.face_projection import project
from warp_mca.geometry.keyword_text import Keyword
from warp_mca.geometry.mesh import Mesh
from warp_mca.scene.contacts import MOST_FRICTION, Contact, ContactAll, RigidPlane, Surface
from warp_mca.scene.friction_laws import DecayingFriction, FrictionLaw, ShearCap
from warp_mca.scene.tied_surfaces import Tie

SIDES = "ssid msid sstyp mstyp sboxid mboxid spr mpr"
FRICTION = "fs fd dc vc vdc penchk bt dt"
SCALES = "sfs sfm sst mst sfst sfmt fsf vsf"
OPTIONS = "soft sofscl lcidab maxpar sbopt depth bsort frcfrq"
SLSFAC = 0.1  # default of *CONTROL_CONTACT
WALL = 10.0  # penalty of rigid walls, which stop nodes at once in LS-DYNA: by default, nodes of Taylor's bar sink in
_NAMES = {0: "segments", 4: "nodes"}  # of node sets by the type of a side
NEAR = 0.05  # distance of nodes that are tied, as a share of the edge of the face [-]


@dataclass(frozen=True)
class Side:
    """One side of a contact.

    Attributes:
        body: that has it.
        surface: its name in the scene.
        numbers: nodes of it, as the deck counts.
    """

    body: DeckBody
    surface: Surface
    numbers: Numbers


class Contacts:
    """Reads the contacts of a deck between its bodies, in runs that last `duration` [s]."""

    def __init__(self, content: Content, places: Places, bodies: Sequence[DeckBody], duration: float) -> None:
        self._content, self._places, self._bodies, self._duration = content, places, bodies, duration
        self.contacts: list[Contact | ContactAll] = []
        self.ties: list[tuple[Side, Side]] = []
        self._control = content.last("contact_control", "slsfac rwpnal islchk shlthk penopt thkchg orien enmass")
        self._scale = (self._control and self._control.number("slsfac")) or SLSFAC
        for item in content.found["contact"]:
            self._take(item)
        for item in content.found["wall"]:
            self._take_wall(item)

    def _take(self, item: Keyword) -> None:
        """One contact. Penalties, thicknesses of shells and searches are those of this program."""
        start = 1 if item.name.endswith("_ID") else 0
        sides, friction, scales, options = (
            self._content.card(item, start + k, names) for k, names in enumerate((SIDES, FRICTION, SCALES, OPTIONS))
        )
        name = item.name.removeprefix("CONTACT_").removesuffix("_ID")
        self._check_time(friction, "bt", "dt")
        scales.refuse("sst mst", "surfaces are those of the mesh; set it to 0")
        if "TIED" in name:
            slaves = self._sides(sides, "s", kinds=(0, 2, 3, 4))
            pairs = [(one, other) for other in self._sides(sides, "m") for one in slaves]
            self.ties += [(one, other) for one, other in pairs if one.body is not other.body]
            return
        laws = self._springs(friction, scales, options)
        if "SINGLE" in name:
            self._take_single(item, sides, laws)
            return
        slaves = self._sides(sides, "s", kinds=(0, 2, 3, 4) if "NODES" in name else (0, 2, 3))
        for other in self._sides(sides, "m"):
            for one in slaves:
                if one.body is other.body:
                    remedy = f"both sides belong to {one.body.name}, whose parts share nodes; name sides of two bodies"
                    raise ValueError(f"{sides.place}: {remedy}")
                both = not ("ONE_WAY" in name or "NODES" in name)
                self.contacts.append(Contact(slave=one.surface, master=other.surface, two_way=both, **laws))

    def _check_time(self, card: Card, birth: str, death: str) -> None:
        """Refuse contacts that do not last for the whole run."""
        if card.number(birth, "time") > 0.0 or 0.0 < card.number(death, "time") < self._duration:
            raise ValueError(f"{card.place}: birth and death times are not read: let it act in the whole run")

    def _springs(self, card: Card, scales: Card, options: Card) -> dict[str, Any]:
        """Coefficient and laws of friction."""
        mu, kinetic, decay = card.number("fs"), card.number("fd"), card.number("dc", "slowness")
        factor = scales.number("fsf", default=1.0) or 1.0
        if mu < 0.0:
            raise ValueError(f"{card.place}: FS below 0 is not read: give the coefficient of friction")
        laws: list[FrictionLaw] = []
        if decay and kinetic != mu:
            laws.append(DecayingFriction(kinetic=factor * kinetic, decay=decay))
        if mu and (cap := card.number("vc", "stress")):
            laws.append(ShearCap(tau_max=cap * (scales.number("vsf", default=1.0) or 1.0)))
        own = [scales.number(name, default=1.0) or 1.0 for name in ("sfs", "sfm")]
        if own != [1.0, 1.0] or card.number("vdc") or options.number("soft") or self._scale != SLSFAC:
            what = "SFS, SFM, VDC, SOFT and SLSFAC are left out: springs of contact are those of this program"
            self._content.notes.append(f"{card.place}: {what}")
        return {"mu": factor * mu, "friction": tuple(laws)}

    def _take_single(self, item: Keyword, card: Card, laws: dict[str, Any]) -> None:
        """General contact of some bodies, or of all."""
        kind, number = card.whole("sstyp"), card.whole("ssid")
        if number and kind not in (2, 3, 5, 6):
            raise ValueError(f"{card.place}: SSTYP = {kind} is not read here: give parts, or SSID = 0 for all")
        card.refuse("sboxid", "name parts")
        named = self._places.parts(number) if kind in (2, 6) and number else [number]
        everything = not number or kind == 5
        taken = [
            body
            for body in self._bodies
            if everything or any((part.number in named) == (kind != 6) for part in body.parts)
        ]
        if any(isinstance(contact, ContactAll) for contact in self.contacts):
            raise ValueError(f"{item.place}: a second *{item.name} is not read: name its parts in one")
        out = [
            (one.name, other.name)
            for one, other in combinations_with_replacement(self._bodies, 2)
            if one not in taken or other not in taken
        ]
        skin = {body.name: Surface(body=body.name, nodes="boundary") for body in taken}
        pairs = [(one, other) for one, other in combinations_with_replacement(taken, 2) if one is not other]
        failing = any(part.material.law.failure for body in taken for part in body.parts)
        if failing:
            self._content.notes.append(f"{item.place}: bodies that may fail have no contact with themselves")
        self.contacts += [
            Contact(slave=skin[one.name], master=skin[other.name], two_way=True, **laws)
            for one, other in pairs
            if failing or (one.rigid and other.rigid)
        ]
        if not failing and not all(body.rigid for body in taken):
            self.contacts.append(ContactAll(exclude=tuple(out), **laws))

    def _sides(self, card: Card, letter: str, kinds: tuple[int, ...] = (0, 2, 3)) -> list[Side]:
        """The slave side "s" or the master side "m" on each body that has nodes of it."""
        number, kind = card.whole(f"{letter}sid"), card.whole(f"{letter}styp")
        if kind not in kinds or not number:
            known = ", ".join(map(str, kinds))
            raise ValueError(f"{card.place}: type {kind} of side {number} is not read: give a number, and {known}")
        box = card.whole(f"{letter}boxid")
        found = []
        for body, numbers, whole in self._members(number, kind):
            if box:
                numbers, whole = np.intersect1d(numbers, self._places.in_box(box)), False
            name = "boundary" if whole else body.keep(f"{_NAMES.get(kind, 'part')}_{number}", numbers)
            found.append(Side(body, Surface(body=body.name, nodes=name), numbers))
        if not found:
            raise ValueError(f"{card.place}: no body has nodes of side {number}; name another")
        return found

    def _members(self, number: int, kind: int) -> Iterator[tuple[DeckBody, Numbers, bool]]:
        """Bodies, their nodes on a side, and whether these are the whole body."""
        parts = self._places.parts(number) if kind == 2 else [number] if kind == 3 else []
        if kind in (2, 3):
            given = self._places.of_parts(parts)
        else:
            given = self._places.nodes(number) if kind == 4 else self._places.segments(number)
        for body in self._bodies:
            whole = {part.number for part in body.parts} <= set(parts)
            if len(numbers := body.own(given)):
                yield body, numbers, whole

    def _take_wall(self, item: Keyword) -> None:
        """*RIGIDWALL_PLANAR. Nodes of rigid parts pass it unless *CONTROL_CONTACT has RWPNAL."""
        start = 1 if item.name.endswith("_ID") else 0
        head = self._content.card(item, start, "nsid nsidex boxid offset birth death rwksf")
        card = self._content.card(item, start + 1, "xt yt zt xh yh zh fric wvel")
        self._check_time(head, "birth", "death")
        point = card.numbers("xt yt zt", "length")
        normal = [end - own for end, own in zip(card.numbers("xh yh zh", "length"), point, strict=True)]
        friction = card.number("fric")
        if not 0.0 <= friction <= 1.0:
            raise ValueError(f"{card.place}: FRIC = {friction:g} is not read: give 0 to 1, which sticks")
        numbers = self._on_wall(head, np.array(point), np.array(normal))
        plane = RigidPlane(point=(point[0], point[1], point[2]), normal=(normal[0], normal[1], normal[2]))
        for body in self._bodies:
            if body.rigid and not (self._control and self._control.number("rwpnal")):
                self._content.notes.append(
                    f"{item.place}: rigid part {body.name} passes the wall, as RWPNAL of *CONTROL_CONTACT is 0"
                )
                continue
            own = body.nodes if numbers is None else body.own(numbers)
            if not len(own):
                continue
            name = "boundary" if numbers is None else body.keep(f"wall_{head.whole('nsid')}", own)
            slave, mu = Surface(body=body.name, nodes=name), MOST_FRICTION if friction == 1.0 else friction
            self.contacts.append(Contact(slave=slave, master=plane, mu=mu, penalty=WALL))

    def _on_wall(self, card: Card, point: Any, normal: Any) -> Numbers | None:
        """Nodes that a wall stops, or None for all."""
        numbers = None
        if card.whole("nsid"):
            numbers = self._places.nodes(card.whole("nsid"))
        if card.whole("boxid"):
            inside = self._places.in_box(card.whole("boxid"))
            numbers = inside if numbers is None else np.intersect1d(numbers, inside)
        if offset := card.number("offset", "length"):
            height = (self._content.units.length * self._places.points - point) @ normal / np.linalg.norm(normal)
            near = self._places.numbers[height <= offset]
            numbers = near if numbers is None else np.intersect1d(numbers, near)
        if card.whole("nsidex"):
            out = self._places.nodes(card.whole("nsidex"))
            numbers = np.setdiff1d(self._places.numbers if numbers is None else numbers, out)
        return numbers


def ties(pairs: Sequence[tuple[Side, Side]], meshes: dict[str, Mesh]) -> list[Tie]:
    """Ties of the faces of slaves whose nodes lie on masters; meshes get the node sets of these faces.

    Raises:
        ValueError: no face of a slave lies on its master.
    """
    found = []
    for k, (one, other) in enumerate(pairs, 1):
        slave, master = meshes[one.body.name], meshes[other.body.name]
        faces, _ = slave.surface(one.surface.nodes)
        onto, _ = master.surface(other.surface.nodes)
        nodes = np.unique(faces)
        at = project(slave.points[nodes], master.points, onto)
        corner = master.points[onto[at.face]]
        edge = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).max(axis=1)
        near = np.zeros(len(slave.points), dtype=bool)
        near[nodes] = (at.distance <= NEAR * edge) & (at.beyond <= NEAR)
        tied = faces[near[faces].all(axis=1)]
        if not len(tied):
            what = f"no face of {one.surface.nodes} of {one.body.name} lies on {other.body.name}"
            raise ValueError(f"{what}; let tied surfaces meet within a twentieth of a cell")
        name = f"tied_{k}"
        slave.node_sets[name] = np.unique(tied).astype(np.int32)
        found.append(Tie(slave=Surface(body=one.body.name, nodes=name), master=other.surface, gap=2.0 * NEAR))
    return found
