"""Owns what input decks of finite-element codes have in common: nodes and cells by number, sets by name, what is left
out."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_mca.geometry.cell_types import CELL_TYPES, QUADRATIC, TETRA10, TETRAHEDRON
from warp_mca.geometry.deck_rules import ELEMENTS, OTHER
from warp_mca.geometry.markings import lie_on

if TYPE_CHECKING:
    import meshio

_CORNERS = {cell.meshio: cell.corners for cell in CELL_TYPES.values()}
SHOWN = 12  # keywords that no table has, in a warning
_LOWER = {2: "line", 3: "triangle", 4: "quad"}  # meshio's names of cells that are no solids, by their corners
_EXPONENT = re.compile(r"(?<=[\d.])(?:[dD]|(?=[+-]))([+-]?\d+)$")  # Fortran's 1.5D3, 1.5D+3 and 1.5+3


@dataclass
class Deck:
    """What a file holds, by the file's own numbers.

    Attributes:
        path: of the file.
        nodes: places of the nodes, in the file's unit.
        cells: meshio's name and the corners of each solid.
        faces: the same of shells, beams and others, whose sets become node sets; "" where the shape is not known.
        marks: those of `faces` that mark faces of solids, and are left out only where no solid lies.
        node_sets, cell_sets: members by name.
        left: how many there are of each (kind, name) that is left out.
        quadratic: number of quadratic solids by meshio's name.
    """

    path: Path
    nodes: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    cells: dict[int, tuple[str, list[int]]] = field(default_factory=dict)
    faces: dict[int, tuple[str, list[int]]] = field(default_factory=dict)
    marks: dict[int, str] = field(default_factory=dict)
    node_sets: dict[str, list[int]] = field(default_factory=dict)
    cell_sets: dict[str, list[int]] = field(default_factory=dict)
    left: Counter[tuple[str, str]] = field(default_factory=Counter)
    quadratic: Counter[str] = field(default_factory=Counter)

    def add_node(self, number: int, place: tuple[float, float, float]) -> None:
        """Takes a node; one that is given again must lie where it did."""
        if self.nodes.setdefault(number, place) != place:
            raise ValueError(f"node {number} is given twice, at {self.nodes[number]} and {place}")

    def add_cell(self, number: int, kind: str, nodes: list[int]) -> None:
        """Takes a solid; of quadratic ones the corners are kept, of ten-node tetrahedra with all nodes these."""
        self._check_new(number)
        if kind in QUADRATIC and (kind not in _CORNERS or len(nodes) < _CORNERS[kind]):
            self.quadratic[kind] += 1
            _, kind, _ = QUADRATIC[kind]
        self.cells[number] = kind, nodes[: _CORNERS[kind]]

    def add_face(self, number: int, name: str, corners: list[int], mark: bool = False) -> None:
        """Takes an element that is no solid; a `mark` is left out only where it does not lie on solids."""
        self._check_new(number)
        self.faces[number] = _LOWER.get(len(corners), ""), corners
        if mark:
            self.marks[number] = name
        else:
            self.left[ELEMENTS, name] += 1

    def _check_new(self, number: int) -> None:
        if number in self.cells or number in self.faces:
            raise ValueError(f"element {number} is given twice")

    def mesh(self) -> tuple[meshio.Mesh, list[str]]:
        """The mesh, and the sentences about what is left out.

        Raises:
            ValueError: a solid has a node that is not given.
        """
        import meshio

        index = {number: k for k, number in enumerate(self.nodes)}
        blocks: dict[str, list[list[int]]] = {kind: [] for kind in (*_CORNERS, *_LOWER.values())}
        places: dict[int, tuple[str, int]] = {}  # block of each element, and its place there
        for number, (kind, corners) in (*self.cells.items(), *self.faces.items()):
            try:
                row = [index[node] for node in corners]
            except KeyError as error:
                if number in self.cells:
                    raise ValueError(f"element {number} has node {error.args[0]}, which is not given") from error
                continue
            if kind:
                places[number] = kind, len(blocks[kind])
                blocks[kind].append(row)
        cells = {kind: np.array(rows) for kind, rows in blocks.items() if rows}
        self._look_at_marks(cells, places)
        point_sets: dict[str, Any] = {}
        for name, members in self.node_sets.items():
            self._count_missing(number not in index for number in members)
            point_sets[name] = np.array([index[n] for n in members if n in index], dtype=np.int64)
        cell_sets: dict[str, Any] = {}
        for name, members in self.cell_sets.items():
            self._count_missing(number not in self.cells and number not in self.faces for number in members)
            found = [places[number] for number in members if number in places]
            if found:
                cell_sets[name] = [np.array([k for kind, k in found if kind == own], dtype=np.int64) for own in cells]
        points = np.array(list(self.nodes.values()), dtype=np.float64).reshape(-1, 3)
        read = meshio.Mesh(points, list(cells.items()), point_sets=point_sets, cell_sets=cell_sets)
        return read, quadratic_notes(self.path, self.quadratic + linear(read)) + left_out_notes(self.path, self.left)

    def _count_missing(self, missing: Iterable[bool]) -> None:
        if count := sum(missing):
            self.left["numbers in sets that nothing has", ""] += count

    def _look_at_marks(self, cells: Mapping[str, np.ndarray], places: Mapping[int, tuple[str, int]]) -> None:
        """Counts the marks that do not lie on solids as left out."""
        solids = [cells[kind] for kind in _CORNERS if kind in cells]
        on = {kind: lie_on(cells[kind], solids) for kind in _LOWER.values() if kind in cells and self.marks}
        for number, name in self.marks.items():
            kind, place = places.get(number, ("", 0))
            if not kind or not on[kind][place]:
                self.left[ELEMENTS, name] += 1


def linear(read: meshio.Mesh) -> Counter[str]:
    """Makes quadratic cells linear ones, whose corners come first in all formats. How many there were, by type.

    Ten-node tetrahedra stay unless they share nodes with other solids, whose edges would not have the nodes of theirs.
    """
    solids = [(block.type == TETRA10.meshio, block.data) for block in read.cells if block.dim == 3]
    ten = [np.asarray(data)[:, : TETRAHEDRON.corners].ravel() for mine, data in solids if mine]
    rest = [np.asarray(data).ravel() for mine, data in solids if not mine]
    mixed = bool(ten and rest) and np.isin(np.concatenate(ten), np.concatenate(rest)).any()
    found: Counter[str] = Counter()
    for block in read.cells:
        if block.type in QUADRATIC and len(block.data) and (mixed or block.type != TETRA10.meshio):
            found[block.type] += len(block.data)
            _, block.type, corners = QUADRATIC[block.type]
            block.data = block.data[:, :corners]
    return found


def left_out_notes(path: str | Path, left: Mapping[tuple[str, str], int]) -> list[str]:
    """One sentence with the counts of what is left out, by kind and name; none where nothing is."""
    kinds: dict[str, Counter[str]] = {}
    for (kind, name), count in left.items():
        kinds.setdefault(kind, Counter())[name] += count
    parts = [f"{count} {name}" for name, count in kinds.pop(ELEMENTS, Counter()).items()]
    other = kinds.pop(OTHER, None)
    parts += [f"{sum(c.values())} {kind}" + (f" ({', '.join(c)})" if any(c) else "") for kind, c in kinds.items()]
    if other:
        more = f" and {len(other) - SHOWN} more" if len(other) > SHOWN else ""
        parts.append(f"{OTHER} ({', '.join(list(other)[:SHOWN])}{more})")
    if not parts:
        return []
    return [f"{path}: nodes, solid cells and sets are read; left out are {', '.join(parts)}"]


def quadratic_notes(path: str | Path, counts: Mapping[str, int]) -> list[str]:
    """One sentence about quadratic cells, which are taken as linear ones; none where there are none."""
    if not counts:
        return []
    kinds, count = ", ".join(sorted(counts)), sum(counts.values())
    return [f"{path}: {count} quadratic cells ({kinds}) are taken as linear ones, without the nodes in edges"]


@dataclass(frozen=True)
class Block:
    """A keyword line without its asterisk, and the data lines below it, each with its number in the file."""

    keyword: str
    line: int
    data: list[tuple[int, str]]


def blocks(path: Path, comment: str, indented: bool = False) -> Iterator[Block]:
    """Blocks of a file whose keyword lines begin with an asterisk; the first one holds what stands before these.

    Args:
        path: of the file.
        comment: how comments begin, which are left out.
        indented: whether keywords and comments may stand behind blanks.
    """
    block = Block("", 0, [])
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        for number, text in enumerate(file, 1):
            line = text.strip() if indented else text.rstrip()
            if line.startswith(comment):
                continue
            if line.startswith("*"):
                yield block
                block = Block(line[1:], number, [])
            elif line or not indented:  # a title may be blank
                block.data.append((number, line))
    yield block


def integer(text: str) -> int:
    """A whole number.

    Raises:
        ValueError: it is none.
    """
    try:
        return int(text)
    except ValueError as error:
        raise ValueError(f"{text.strip()!r} is no whole number") from error


def real(text: str) -> float:
    """A number as Fortran writes it; 0 for a blank.

    Raises:
        ValueError: it is none.
    """
    text = text.strip()
    try:
        return float(text or 0.0)
    except ValueError:
        try:
            return float(_EXPONENT.sub(r"e\1", text))
        except ValueError as error:
            raise ValueError(f"{text!r} is no number") from error
