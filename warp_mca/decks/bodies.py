"""Owns the bodies of a deck: parts that share nodes are one body, with a material for each part."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from warp_mca.decks.cards import Content
from warp_mca.decks.materials import DeckMaterial
from warp_mca.decks.places import Numbers
from warp_mca.geometry.deck import Deck
from warp_mca.geometry.mesh import Mesh
from warp_mca.geometry.mesh_file import MeshFile
from warp_mca.scene.bodies import Body

ELFORMS = {1: "hex8r", 2: "hex8", -1: "hex8i", -2: "hex8i", 10: "hex8r", 15: "hex8i", 16: "hex8r", 18: "hex8i"}
"""Elements of hexahedra by ELFORM of *SECTION_SOLID. Tetrahedra are tet4 or tet10 by their nodes, wedges wedge6 unless
hex8 or hex8r is named: 10, 15 and 16 are those of tetrahedra and wedges alone."""
_BRICKS = ("hexahedron", "wedge", "pyramid")


@dataclass
class DeckPart:
    """A part with solids.

    Attributes:
        number: as the deck counts.
        name: its title, or part_N.
        elform: of its section.
        material: of its solids.
        place: of its card.
    """

    number: int
    name: str
    elform: int
    material: DeckMaterial
    place: str


@dataclass
class DeckBody:
    """Parts that share nodes.

    Attributes:
        parts: of the body.
        nodes: that its solids use, in the order of the deck.
        sets: more node sets of its mesh by name, as the deck counts nodes.
    """

    parts: list[DeckPart]
    nodes: Numbers
    sets: dict[str, Numbers] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """The names of its parts."""
        return "+".join(part.name for part in self.parts)

    @property
    def rigid(self) -> bool:
        """Whether its one part is rigid."""
        return self.parts[0].material.rigid

    @cached_property
    def index(self) -> dict[int, int]:
        """Place of each node in the mesh by its number."""
        return {int(number): k for k, number in enumerate(self.nodes)}

    def own(self, numbers: Iterable[int]) -> Numbers:
        """Those of some nodes that the body has."""
        return np.array([number for number in numbers if int(number) in self.index], dtype=np.int64)

    def keep(self, name: str, numbers: Iterable[int]) -> str:
        """Keep a node set for the mesh, under a name that no other one has; the name."""
        own = self.own(numbers)
        names = (name if k == 1 else f"{name} ({k})" for k in range(1, 2 + len(self.sets)))
        for key in names:
            if key not in self.sets or np.array_equal(self.sets[key], own):
                self.sets[key] = own
                return key
        raise AssertionError(name)


def deck_parts(content: Content, laws: Mapping[tuple[int, int], DeckMaterial]) -> dict[int, DeckPart]:
    """The parts that have solids, by number.

    Raises:
        ValueError: one has no section or material that is read.
    """
    sections = {
        card.whole("secid"): card
        for item in content.found["section"]
        for k in range(0, len(item.lines), 1 + item.titled)
        if (card := content.card(item, k, "secid elform aet")).values.get("secid")
    }
    found: dict[int, DeckPart] = {}
    taken: set[str] = set()
    for item in content.found["part"]:
        for (_, title), (place, line) in zip(item.lines[::2], item.lines[1::2], strict=False):
            card = content.read(item, place, line, "pid secid mid eosid hgid grav adpopt tmid")
            number = card.whole("pid")
            if number not in content.mesh.parts:
                continue
            key = card.whole("mid"), card.whole("eosid")
            if card.whole("secid") not in sections:
                remedy = f"has no *SECTION_SOLID {card.whole('secid')}; give it one"
                raise ValueError(f"{place}: part {number} {remedy}")
            if key not in laws:
                raise ValueError(f"{place}: part {number} has no material {key[0]} that is read; give it one")
            elform = sections[card.whole("secid")].whole("elform") or 1
            if elform not in ELFORMS:
                known = ", ".join(map(str, ELFORMS))
                raise ValueError(f"{place}: part {number} has ELFORM {elform}, which is not read; choose among {known}")
            name = title.strip() if title.strip() and title.strip() not in taken else f"part_{number}"
            taken.add(name)
            found[number] = DeckPart(number, name, elform, laws[key], place)
    if missing := sorted(set(content.mesh.parts) - set(found)):
        raise ValueError(f"solids belong to part {missing[0]}, which is not given; add *PART {missing[0]}")
    return found


def deck_bodies(content: Content, parts: Mapping[int, DeckPart]) -> list[DeckBody]:
    """The bodies, in the order of their first part.

    Raises:
        ValueError: there are no solids, or a rigid part shares nodes with another one.
    """
    cells = content.mesh.deck.cells
    used = {
        number: np.unique([node for cell in content.mesh.parts[number] for node in cells[cell][1]]) for number in parts
    }
    if not used:
        raise ValueError("it has no solids; give *ELEMENT_SOLID")
    groups: list[tuple[list[int], set[int]]] = []
    for number, nodes in used.items():
        own, numbers = set(nodes.tolist()), [number]
        joined = [group for group in groups if not own.isdisjoint(group[1])]
        for group in joined:
            numbers, own = group[0] + numbers, own | group[1]
            groups.remove(group)
        groups.append((numbers, own))
    order = {number: k for k, number in enumerate(parts)}
    groups = sorted(((sorted(one, key=order.__getitem__), own) for one, own in groups), key=lambda g: order[g[0][0]])
    found = []
    for numbers, own in groups:
        rigid = [parts[number] for number in numbers if parts[number].material.rigid]
        if rigid and len(numbers) > 1:
            remedy = "shares nodes with another part, which is not read; give each nodes of its own"
            raise ValueError(f"{rigid[0].place}: rigid part {rigid[0].number} {remedy}")
        nodes = np.array([node for node in content.mesh.deck.nodes if node in own], dtype=np.int64)
        if missing := own.difference(content.mesh.deck.nodes):
            raise ValueError(f"solids have node {min(missing)}, which is not given; add it to *NODE")
        found.append(DeckBody([parts[number] for number in numbers], nodes))
    return found


def element_of(content: Content, body: DeckBody) -> str:
    """The element of a body.

    Raises:
        ValueError: its parts of hexahedra ask for different ones.
    """
    cells, members = content.mesh.deck.cells, content.mesh.parts
    kinds = {part.number: {cells[k][0] for k in members[part.number]} for part in body.parts}
    asked = {part.elform: part.place for part in body.parts if kinds[part.number].intersection(_BRICKS)}
    if not asked:
        return "tet10" if all(own == {"tetra10"} for own in kinds.values()) else "tet4"
    names = {ELFORMS[elform] for elform in asked}
    if len(names) > 1:
        *_, place = asked.values()
        remedy = "give one to parts that share nodes"
        raise ValueError(f"{place}: ELFORM {' and '.join(map(str, asked))} are different elements; {remedy}")
    return names.pop()


def mesh_of(content: Content, path: Path, body: DeckBody) -> Mesh:
    """The mesh of a body in SI units, with its sets, and a cell set for each of several parts.

    Raises:
        RequestError: it is no sound mesh.
        ValueError: a solid has a node that is not given.
    """
    deck, whole = Deck(path), content.mesh.deck
    deck.nodes = {int(number): whole.nodes[int(number)] for number in body.nodes}
    for part in body.parts:
        members = content.mesh.parts[part.number]
        deck.cells |= {number: whole.cells[number] for number in members}
        deck.cell_sets[part.name] = list(members)
    deck.node_sets = {name: numbers.tolist() for name, numbers in body.sets.items()}
    mesh = MeshFile(path, scale=content.units.length).converted(*deck.mesh())
    return mesh if len(body.parts) > 1 else replace(mesh, cell_sets={})


def body_of(content: Content, path: Path, body: DeckBody, motion: Mapping[str, Any]) -> Body:
    """A body of the scene, with its initial motion."""
    laws = [part.material.law for part in body.parts]
    same = all(one == other for one, other in pairwise(laws))
    return Body(
        name=body.name,
        geometry=mesh_of(content, path, body),
        material=laws[0] if same else {part.name: part.material.law for part in body.parts},
        element=element_of(content, body),
        kinematics="finite",
        rigid=body.rigid,
        **motion,
    )
