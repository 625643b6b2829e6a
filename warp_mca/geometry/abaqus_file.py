"""Owns the reading of Abaqus and CalculiX input files: nodes, solids and sets, of parts where instances place them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from warp_mca.geometry.abaqus_placing import UNMOVED, Placing
from warp_mca.geometry.abaqus_sets import ASSEMBLY, Key, NamedSet, SetTable
from warp_mca.geometry.deck import Block, Deck, blocks, integer, real
from warp_mca.geometry.deck_rules import ABAQUS_RULES, OTHER

if TYPE_CHECKING:
    import meshio

ABAQUS_SUFFIXES = (".inp",)
_PARAMETERS = {  # others are left out
    "NODE": {"NSET", "SYSTEM"},
    "ELEMENT": {"TYPE", "ELSET"},
    "NSET": {"NSET", "GENERATE", "ELSET", "INSTANCE", "INTERNAL", "UNSORTED"},
    "ELSET": {"ELSET", "GENERATE", "INSTANCE", "INTERNAL", "UNSORTED"},
    "INSTANCE": {"NAME", "PART"},
}
_REFUSED_PARAMETERS = {"INPUT", "FILE", "OFFSET", "LIBRARY", "SOLIDELEMENTNUMBERING"}
_SOLIDS = re.compile(r"(?:C3D|DC3D|Q3D|CSS|SC)(\d+)[A-UW-Z]*")  # of solids and of conduction of heat in these
_KINDS = {
    **{4: "tetra", 5: "pyramid", 6: "wedge", 8: "hexahedron"},
    **{10: "tetra10", 13: "pyramid13", 15: "wedge15", 20: "hexahedron20", 27: "hexahedron27"},
}
_FACES = re.compile(r"(?:S|DS|STRI|M3D|R3D|SFM3D|CP[SE]|CPEG|CAX|DC2D|DCAX)([34689])")  # shells, plane ones and others
_LINES = re.compile(r"(?:T3D|T2D|DC1D|R2D)[23]|B[23][123]")
_QUADRATIC_LINES = re.compile(r"(?:T3D|T2D|DC1D)3|B[23]2")
_CORNERS = {3: 3, 4: 4, 6: 3, 8: 4, 9: 4}  # of faces, by their nodes
_MARKS = re.compile(r"CP[SE]\d.*|T3D\d LINE\d+")  # plane elements and trusses with their set, as gmsh marks places
_LONGEST = 16  # numbers in a line
STRIDE = 10**12  # between the numbers that an instance's nodes and elements get and those of the next one
_FLAGS = {"GENERATE", "INTERNAL", "UNSORTED"}
Parameters = dict[str, str]
Data = list[tuple[int, str]]


def read_abaqus(path: Path) -> tuple[meshio.Mesh, list[str]]:
    """The solids of an input file with its sets, and sentences about what is left out.

    Each instance of a part is read anew, in its place; of several, each is a set of cells, too. Sets may hold sets that
    are defined later. A set of shells, beams and other elements is one of their corners.

    Raises:
        ValueError: a line cannot be read, or a keyword would change the mesh in a way that is not read.
    """
    reader = _Reader(Deck(path))
    for block in joined(blocks(path, "**", indented=True)):
        try:
            reader.take(block)
        except ValueError as error:
            raise ValueError(f"line {reader.line}: {error}") from error
    return reader.finish()


def joined(found: Iterator[Block]) -> Iterator[Block]:
    """The blocks with keyword lines that go on after a comma put together."""
    for block in found:
        keyword, data = block.keyword, block.data
        while keyword.endswith(",") and data and ("=" in data[0][1] or data[0][1].strip(" ,").upper() in _FLAGS):
            keyword, data = keyword + data[0][1], data[1:]
        yield Block(keyword, block.line, data)


def _parameters(text: str) -> tuple[str, Parameters]:
    """The keyword in capitals without blanks, and its parameters; values without quotes."""
    first, *rest = re.findall(r'(?:"[^"]*"|[^,"])+', text) or [""]
    pairs = (part.partition("=") for part in rest if part.strip())
    return re.sub(r"\s", "", first).upper(), {
        re.sub(r"\s", "", key).upper(): value.strip().strip('"').strip() for key, _, value in pairs
    }


def _fields(text: str) -> list[str]:
    """The fields of a data line, without the empty one after a trailing comma."""
    found = [entry.strip() for entry in text.split(",")]
    while found and not found[-1]:
        found.pop()
    return found


def _shape(name: str) -> tuple[int, int]:
    """Number of nodes and of corners of a type that is no solid; 0 where they are not known."""
    if face := _FACES.match(name):
        return int(face[1]), _CORNERS[int(face[1])]
    return (3 if _QUADRATIC_LINES.match(name) else 2, 2) if _LINES.match(name) else (0, 0)


class _Reader:
    """Takes the blocks of a file in turn. Numbers of an assembly's own nodes and elements are kept negative.

    A part is read where an instance puts it, or at the end of a file without instances.
    """

    def __init__(self, deck: Deck) -> None:
        self.deck, self.line = deck, 0
        self.sets = SetTable()
        self.parts: dict[str, list[Block]] = {}
        self.part: str | None = None  # that is being kept
        self.instances: list[str] = []
        self.placing = UNMOVED
        self.scope = 0  # as in `abaqus_sets`
        self.in_step = False

    def take(self, block: Block) -> None:
        """Read one block, or keep it for the instances of its part, or count it."""
        self.line = block.line
        keyword, parameters = _parameters(block.keyword)
        if self.part is not None and keyword != "ENDPART":
            self.parts[self.part].append(block)
            return
        for name in parameters.keys() - _PARAMETERS.get(keyword, parameters.keys()):
            if name in _REFUSED_PARAMETERS:
                raise ValueError(f"*{keyword} with the parameter {name} is not read")
            self.deck.left["parameters", f"{name} of *{keyword}"] += 1
        try:
            kind = ABAQUS_RULES.kind(keyword)
        except ValueError as error:
            raise ValueError(f"*{error}") from error
        if kind == "read":
            getattr(self, f"_take_{keyword.lower().removeprefix('end')}")(keyword, parameters, block.data)
        elif kind and not (self.in_step and kind == OTHER):  # a step is told as a whole
            self.deck.left[kind, f"*{keyword}"] += 1

    def _take_part(self, keyword: str, parameters: Parameters, data: Data) -> None:
        self.part = parameters.get("NAME", "part").upper() if keyword == "PART" else None
        if self.part is not None and self.parts.setdefault(self.part, []):
            raise ValueError(f"part {parameters.get('NAME', 'part')} is given twice")

    def _take_assembly(self, keyword: str, parameters: Parameters, data: Data) -> None:
        self.scope = ASSEMBLY if keyword == "ASSEMBLY" else 0

    def _take_instance(self, keyword: str, parameters: Parameters, data: Data) -> None:
        self.scope, self.placing = ASSEMBLY, UNMOVED
        if keyword == "INSTANCE":
            name, part = parameters.get("NAME", "instance"), parameters.get("PART", "part").upper()
            if self._instance(name) is not None:
                raise ValueError(f"instance {name} is given twice")
            if part not in self.parts:
                raise ValueError(f"there is no *PART {parameters.get('PART', 'part')} for instance {name}")
            self.instances.append(name)
            self.placing = Placing.of([[real(entry) for entry in _fields(text)] for _, text in data])
            self._read_part(part, len(self.instances) - 1)

    def _read_part(self, part: str, scope: int) -> None:
        """Read the blocks of a part as those of an instance."""
        self.scope, line = scope, self.line
        for block in self.parts[part]:
            self.take(block)
        self.line = line

    def _instance(self, name: str) -> int | None:
        """The scope of an instance, or None where there is none of that name."""
        return next((k for k, own in enumerate(self.instances) if own.upper() == name.upper()), None)

    def _take_step(self, keyword: str, parameters: Parameters, data: Data) -> None:
        self.in_step = keyword == "STEP"
        if self.in_step:
            self.deck.left["steps", "*STEP"] += 1

    def _take_system(self, keyword: str, parameters: Parameters, data: Data) -> None:
        if any(real(entry) for _, text in data for entry in _fields(text)):
            raise ValueError("*SYSTEM is not read: it moves nodes")

    def _take_node(self, keyword: str, parameters: Parameters, data: Data) -> None:
        if parameters.get("SYSTEM", "R").upper() != "R":
            raise ValueError("*NODE with SYSTEM other than R is not read: give x, y and z")
        members = self._set(self.sets.nodes, parameters, "NSET").numbers if "NSET" in parameters else []
        for self.line, text in data:
            number, *place = _fields(text)
            x, y, z = (real(entry) for entry in (*place[:3], "", "", "")[:3])
            self.deck.add_node(self._own(integer(number)), self.placing.place(x, y, z))
            members.append(self._own(integer(number)))

    def _own(self, number: int, scope: int | None = None) -> int:
        """The number that a node or an element of a scope, by default the present one, has in the deck."""
        scope = self.scope if scope is None else scope
        return -number if scope == ASSEMBLY else number + STRIDE * scope

    def _take_element(self, keyword: str, parameters: Parameters, data: Data) -> None:
        if "TYPE" not in parameters:
            raise ValueError("*ELEMENT without TYPE is not read")
        name = re.sub(r"\s", "", parameters["TYPE"]).upper()
        members = self._set(self.sets.elements, parameters, "ELSET").numbers if "ELSET" in parameters else []
        if solid := _SOLIDS.fullmatch(name):
            kind = _KINDS.get(int(solid[1]))
        else:
            kind = None if name.startswith(("C3D", "DC3D")) else ""
        if kind is None:
            raise ValueError(f"elements of the type {name} are not read")
        count, corners = (int(solid[1]), 0) if solid else _shape(name)
        mark = _MARKS.fullmatch(f"{name} {parameters.get('ELSET', '').upper()}") is not None
        for number, nodes in self._elements(data, count) if count else self._unknown(data):
            members.append(number)
            if kind:
                self.deck.add_cell(number, kind, nodes)
            else:
                self.deck.add_face(number, name, nodes[:corners], mark)

    def _elements(self, data: Data, count: int) -> Iterator[tuple[int, list[int]]]:
        """Number and nodes of each element of `count` nodes, which may go on in further lines.

        What a line of less than 16 numbers has beyond these is passed over, as CalculiX does.
        """
        rest: list[int] = []
        for self.line, text in data:
            fields = _fields(text)
            rest += map(integer, fields)
            if len(rest) > 1 + count and len(fields) >= _LONGEST:  # it may go on
                break
            if len(rest) > count:
                yield self._own(rest[0]), [self._own(node) for node in rest[1 : 1 + count]]
                if len(rest) > 1 + count:
                    self.deck.left["numbers beyond the nodes of an element", ""] += len(rest) - 1 - count
                rest = []
        if rest:
            raise ValueError(f"element {rest[0]} has {len(rest) - 1} nodes in place of {count}")

    def _unknown(self, data: Data) -> Iterator[tuple[int, list[int]]]:
        """Number of each element of a type whose number of nodes is not known; it goes on after a comma."""
        goes_on = False
        for self.line, text in data:
            if not goes_on:
                yield self._own(integer(_fields(text)[0])), []
            goes_on = text.endswith(",")

    def _take_nset(self, keyword: str, parameters: Parameters, data: Data) -> None:
        item = self._take_members(self.sets.nodes, keyword, parameters, data)
        if parameters.get("ELSET"):
            item.elsets.append((self._scope_of(parameters), parameters["ELSET"].upper()))

    def _take_elset(self, keyword: str, parameters: Parameters, data: Data) -> None:
        self._take_members(self.sets.elements, keyword, parameters, data)

    def _scope_of(self, parameters: Parameters) -> int:
        """Scope of the numbers of a set."""
        if "INSTANCE" not in parameters or not self.instances:
            return self.scope
        if (found := self._instance(parameters["INSTANCE"])) is None:
            raise ValueError(f"there is no *INSTANCE {parameters['INSTANCE']}")
        return found

    def _take_members(self, sets: dict[Key, NamedSet], keyword: str, parameters: Parameters, data: Data) -> NamedSet:
        item, scope = self._set(sets, parameters, keyword), self._scope_of(parameters)
        for self.line, text in data:
            fields = _fields(text)
            if "GENERATE" in parameters and fields:
                fields = fields * 2 if len(fields) == 1 else fields
                first, last, step = map(integer, (*fields, "1")[:3])
                step = max(step, 1)
                step = -step if scope == ASSEMBLY else step
                first, last = self._own(first, scope), self._own(last, scope)
                item.ranges.append(range(first, last + (1 if step > 0 else -1), step))
                continue
            for entry in filter(None, fields):
                instance, _, inner = entry.partition(".")
                found = self._instance(instance) if inner else None
                name, where = (entry, scope) if found is None else (inner, found)
                if name.isdigit():
                    item.numbers.append(self._own(int(name), where))
                else:
                    item.sets.append((where, name.strip('"').upper()))
        return item

    def _set(self, sets: dict[Key, NamedSet], parameters: Parameters, keyword: str) -> NamedSet:
        """The set that a parameter names."""
        if not (name := parameters.get(keyword)):
            raise ValueError(f"{keyword} lacks a name")
        return sets.setdefault((self.scope, name.upper()), NamedSet(name))

    def finish(self) -> tuple[meshio.Mesh, list[str]]:
        """The mesh, and sentences about what is left out."""
        try:
            if not self.instances:
                for k, part in enumerate(self.parts):
                    self.instances.append(part)
                    self._read_part(part, k)
        except ValueError as error:
            raise ValueError(f"line {self.line}: {error}") from error
        self.sets.close(self.deck, self.instances)
        for k, name in enumerate(self.instances if len(self.instances) > 1 else ()):
            own = [number for number in self.deck.cells if number > 0 and number // STRIDE == k]
            self.deck.cell_sets.setdefault(name, own)
        return self.deck.mesh()
