"""Owns the sets of an Abaqus file: numbers, ranges, other sets, and sets of elements whose nodes they have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from warp_mca.geometry.deck import Deck

ASSEMBLY = -1  # scope of what is the assembly's own; that of the instances is 0, 1, …, and 0 in a file without
Key = tuple[int, str]  # scope of a set, and its name in capitals


@dataclass
class NamedSet:
    """What the lines of a set give.

    Attributes:
        name: as the file writes it first.
        numbers: of members.
        ranges: of members; a number that nothing has is no member.
        sets: other sets of its kind, or of elements, whose nodes it then has: by their table and name.
        elsets: sets of elements whose nodes it has.
    """

    name: str
    numbers: list[int] = field(default_factory=list)
    ranges: list[range] = field(default_factory=list)
    sets: list[Key] = field(default_factory=list)
    elsets: list[Key] = field(default_factory=list)


class SetTable:
    """Sets of nodes and of elements; a set that is given again has the members of both."""

    def __init__(self) -> None:
        self.nodes: dict[Key, NamedSet] = {}
        self.elements: dict[Key, NamedSet] = {}

    def close(self, deck: Deck, instances: Sequence[str]) -> None:
        """Give the deck all sets with their members, in any order of definition.

        Sets of several instances are called "instance.name", as is that of one where the assembly has one of its name.

        Raises:
            ValueError: a set holds one that is not given, or itself.
        """
        for kept, sets in ((deck.cell_sets, self.elements), (deck.node_sets, self.nodes)):
            known: dict[tuple[int, Key], list[int] | None] = {}
            for key, item in sets.items():
                inner = key[0] != ASSEMBLY and (len(instances) > 1 or (ASSEMBLY, key[1]) in sets)
                name = f"{instances[key[0]] if instances else ''}.{item.name}" if inner else item.name
                kept[name] = self._members(deck, sets, key, known)

    def _members(
        self, deck: Deck, sets: dict[Key, NamedSet], key: Key, known: dict[tuple[int, Key], list[int] | None]
    ) -> list[int]:
        """Numbers in a set and in all that it holds; `known` keeps those of sets that are done, None of those begun."""
        item, of_nodes = sets[key], sets is self.nodes
        if (id(sets), key) in known:
            if (done := known[id(sets), key]) is None:
                raise ValueError(f"set {item.name} holds itself")
            return done
        known[id(sets), key] = None
        found = list(item.numbers)
        tables = [deck.nodes] if of_nodes else [deck.cells, deck.faces]
        for span in item.ranges:
            if len(span) < sum(map(len, tables)):
                found += [number for number in span if any(number in table for table in tables)]
            else:
                found += [number for table in tables for number in table if number in span]
        for reference in item.sets:
            inner = _find(reference, sets)
            if inner is not None:
                found += self._members(deck, sets, inner, known)
            elif of_nodes and _find(reference, self.elements):
                item.elsets.append(reference)
            else:
                raise ValueError(f"set {item.name} holds set {reference[1]}, which is not given")
        for reference in item.elsets:
            inner = _find(reference, self.elements)
            if inner is None:
                raise ValueError(f"node set {item.name} is that of element set {reference[1]}, which is not given")
            for number in self._members(deck, self.elements, inner, known):
                found += next((t[number][1] for t in (deck.cells, deck.faces) if number in t), [])
        members = known[id(sets), key] = list(dict.fromkeys(found))
        return members


def _find(reference: Key, sets: dict[Key, NamedSet]) -> Key | None:
    """The set that is meant: the one of that scope, else the assembly's, else that of the one instance that has it."""
    scope, name = reference
    if found := next((key for key in ((scope, name), (ASSEMBLY, name)) if key in sets), None):
        return found
    others = [key for key in sets if key[1] == name and scope == ASSEMBLY]
    return others[0] if len(others) == 1 else None
