"""Owns cards of keywords by the names of their fields, and the keywords of a deck by what reads them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from warp_mca.decks import rules
from warp_mca.decks.units import Units
from warp_mca.geometry.deck import real
from warp_mca.geometry.keyword_file import MeshReader
from warp_mca.geometry.keyword_text import EIGHT, Keyword, keywords, whole

# Why keywords are not read, behind their names.
OWN, HARMLESS = "left to the elements of this program", "left out, which changes no result"
EMPTY, ASKED = "left out, without cards", "left out, as asked"


@dataclass(frozen=True)
class Card:
    """A card.

    Attributes:
        place: of its line.
        values: texts of the fields by name; a blank is "".
        units: of the deck.
    """

    place: str
    values: dict[str, str]
    units: Units

    def number(self, name: str, quantity: str = "number", default: float = 0.0) -> float:
        """A field in SI units; the default, in SI units too, for a blank.

        Raises:
            ValueError: it is no number.
        """
        if not self.values.get(name):
            return default
        try:
            return self.units.si(real(self.values[name]), quantity)
        except ValueError as error:
            raise ValueError(f"{self.place}: {error}") from error

    def whole(self, name: str) -> int:
        """A whole number; 0 for a blank.

        Raises:
            ValueError: it is none.
        """
        try:
            return whole(self.values.get(name, ""))
        except ValueError as error:
            raise ValueError(f"{self.place}: {error}") from error

    def numbers(self, names: str, quantity: str = "number") -> list[float]:
        """Several fields, by their names with blanks between."""
        return [self.number(name, quantity) for name in names.split()]

    def refuse(self, names: str, why: str) -> None:
        """Refuse fields that are not zero or blank.

        Raises:
            ValueError: one is not.
        """
        for name in names.split():
            if self.number(name):
                raise ValueError(f"{self.place}: {name.upper()} = {self.values[name]} is not read: {why}")


class Content:
    """The keywords of a deck by what reads them.

    Attributes:
        mesh: nodes and solids.
        found: keywords by kind, as in `rules.READ`.
        notes: sentences about what was left out or taken otherwise.
        units: of the deck.
    """

    def __init__(self, path: Path, units: Units, leave_out: Sequence[str]) -> None:
        """Read all files of a deck.

        Raises:
            ValueError: it has keywords that are not understood, or cards that cannot be read.
        """
        self.mesh, self.units = MeshReader(path), units
        self.found: dict[str, list[Keyword]] = {key: [] for key in rules.READ}
        self.notes: list[str] = []
        unknown: dict[str, str] = {}
        unread: dict[str, dict[str, str]] = {why: {} for why in (OWN, HARMLESS, EMPTY, ASKED)}
        for item in keywords(path):
            kind = rules.kind(item.name)
            if rules.is_in(item.name, leave_out):
                unread[ASKED].setdefault(item.name, item.place)
            elif kind == "mesh":
                try:
                    self.mesh.take_mesh(item)
                except ValueError as error:
                    raise ValueError(self.mesh.at(error)) from error
            elif kind is None:
                bare = not rules.is_in(item.name, rules.BARE) and not any(line.strip() for _, line in item.lines)
                (unread[EMPTY] if bare else unknown).setdefault(item.name, item.place)
            elif kind in ("numerics", "harmless"):
                unread[OWN if kind == "numerics" else HARMLESS].setdefault(item.name, item.place)
            elif kind:
                self.found[kind].append(item)
        if unknown:
            remedy = "write the deck without, or name them in leave_out (--leave-out)"
            raise ValueError(f"{_listed(unknown)} not read; {remedy}")
        self.notes += [f"{path}: {_listed(places)} {why}" for why, places in unread.items() if places]

    def card(self, item: Keyword, index: int, names: str, widths: Sequence[int] = EIGHT) -> Card:
        """A card of a keyword, counted from 0 behind its title; one that is missing is blank."""
        index += item.titled
        place, line = item.lines[index] if index < len(item.lines) else (item.place, "")
        return self.read(item, place, line, names, widths)

    def cards(self, item: Keyword, names: str, start: int = 0, widths: Sequence[int] = EIGHT) -> Iterator[Card]:
        """All cards from one on, counted from 0 behind the title, that are not blank."""
        for place, line in item.lines[start + item.titled :]:
            if line.strip():
                yield self.read(item, place, line, names, widths)

    def read(self, item: Keyword, place: str, line: str, names: str, widths: Sequence[int] = EIGHT) -> Card:
        """A line as a card.

        Raises:
            ValueError: a parameter of it is not given.
        """
        try:
            values = item.fields(line, widths)
        except ValueError as error:
            raise ValueError(f"{place}: {error}") from error
        return Card(place, dict(zip(names.split(), values, strict=False)), self.units)

    def last(self, kind: str, names: str) -> Card | None:
        """First card of the last keyword of a kind, or None."""
        return self.card(self.found[kind][-1], 0, names) if self.found[kind] else None


def _listed(places: dict[str, str]) -> str:
    """Keywords with the places where they stand first, and the verb."""
    words = ", ".join(f"*{name} ({place})" for name, place in places.items())
    return f"{words} {'are' if len(places) > 1 else 'is'}"
