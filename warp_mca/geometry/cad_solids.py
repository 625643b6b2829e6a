"""Owns the solids of a CAD file: their names, those that a part takes, how they are glued, and which of them touch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.base.errors import bad_value
from warp_mca.geometry.cad_drawing import UNITS, draw, explained, plain_name, reading_time
from warp_mca.geometry.gmsh_session import allow, gmsh_session

NEAR = 2e-3  # of the smaller solid's diagonal: solids with a gap up to this are taken to touch [-]
ROUNDING = 1e-5  # of that: gaps of OpenCASCADE's own tolerance are none [-]
_PAIR = 30.0  # time that gmsh may take for a pair of solids, many times its need [s]

Place = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Solid:
    """A solid of a CAD file.

    Attributes:
        name: that of the file, "_2", "_3", ... for more of one name; "solid_N" without one.
        volume: [m^3].
        low, high: corners of the box around it [m].
        wall: its mean thickness, 2 V / A [m].
    """

    name: str
    volume: float
    low: Place
    high: Place
    wall: float


@dataclass(frozen=True, kw_only=True)
class Touch:
    """Two solids that touch, nearly touch or overlap.

    Attributes:
        solids: their names.
        gap: distance between them [m]; 0 where they touch or overlap.
        depth: mean thickness of what they share [m]; 0 where they only touch.
        at: middle of what they share, or where they are nearest [m].
    """

    solids: tuple[str, str]
    gap: float
    depth: float
    at: Place

    @property
    def text(self) -> str:
        """How exactly they fit, in words."""
        one, other = self.solids
        place = "at ({:.4g}, {:.4g}, {:.4g}) m".format(*self.at)
        if self.depth > 0.0:
            return f"{one} and {other} overlap by {self.depth:.2g} m {place}"
        return f"{one} and {other} " + (f"leave a gap of {self.gap:.2g} m {place}" if self.gap else "touch")


def solid_names(model: Any) -> dict[int, str]:
    """A name for each solid of gmsh's model, by its tag."""
    found: dict[int, str] = {}
    for number, (_, tag) in enumerate(model.getEntities(3), start=1):
        # gmsh gives the labels of all assemblies around a solid
        words = [plain_name(word) for word in model.getEntityName(3, tag).split("/")[1:]]
        named = [word for word in words if word and not word.isdigit()]
        name = named[-1] if named else f"solid_{number}"
        taken, k = set(found.values()), 1
        while (unique := name if k == 1 else f"{name}_{k}") in taken:
            k += 1
        found[tag] = unique
    return found


def chosen_solids(model: Any, solids: Sequence[str]) -> dict[int, str]:
    """Leave these solids alone in gmsh's model, or all for (); their names by tag.

    Raises:
        RequestError: the model has no such solid.
    """
    names = solid_names(model)
    for name in solids:
        if name not in names.values():
            raise bad_value("Cad.solids", name, f"the file has {', '.join(names.values())}")
    out = [(3, tag) for tag, name in names.items() if solids and name not in solids]
    if out:
        model.occ.remove(out, recursive=True)
        model.occ.synchronize()
    return {tag: name for tag, name in names.items() if (3, tag) not in out}


def glued(gmsh: Any, names: Mapping[int, str], gap: float) -> dict[int, str]:
    """Let the solids of gmsh's model share their common faces; names of the pieces by tag.

    What solids share where they overlap belongs to the first of them.

    Args:
        gmsh: with the model.
        names: of the solids, by tag.
        gap: up to which faces count as one, in the model's unit.

    Raises:
        RequestError: a solid has no face in common with another one, or lies within others.
    """
    if len(names) < 2:
        return dict(names)
    tags = list(names)
    gmsh.option.setNumber("Geometry.ToleranceBoolean", gap)
    _, pieces = gmsh.model.occ.fragment([(3, tags[0])], [(3, tag) for tag in tags[1:]])
    gmsh.model.occ.synchronize()
    found: dict[int, str] = {}
    for tag, own in zip(tags, pieces, strict=True):
        for dim, piece in own:
            if dim == 3:
                found.setdefault(piece, names[tag])
    if lost := sorted(set(names.values()) - set(found.values())):
        remedy = f"{' and '.join(lost)} lies in the solids before it, whose material counts: cut its place out of them"
        raise bad_value("Cad.glue", True, f"{remedy} in the CAD program")
    joined, left = {next(iter(found))}, set(found)
    sides = {piece: {face for _, face in gmsh.model.getBoundary([(3, piece)], oriented=False)} for piece in found}
    while more := {p for p in left - joined if any(sides[p] & sides[other] for other in joined)}:
        joined |= more
    if alone := sorted({found[piece] for piece in left - joined}):
        remedy = (
            f"{' and '.join(alone)} shares no face with {found[next(iter(found))]}: close the gap in the CAD program"
        )
        raise bad_value("Cad.glue", True, f"{remedy}, or tie these solids instead")
    return found


def inspected(path: str | Path, scale: float | None, stamp: tuple[int, int]) -> tuple[list[Solid], list[Touch]]:
    """Solids of a STEP, IGES or BREP file, and which of them touch.

    Args:
        path, scale: as in `Cad`.
        stamp: when the file was changed last, see `file_stamp`.

    Raises:
        RequestError: gmsh cannot read the file, or it has no solid.
    """
    solids, touching = _inspected(str(Path(path).resolve()), scale or UNITS[Path(path).suffix.lower()], stamp)
    return list(solids), list(touching)


@lru_cache(maxsize=8)
def _inspected(path: str, scale: float, stamp: tuple[int, int]) -> tuple[tuple[Solid, ...], tuple[Touch, ...]]:
    with gmsh_session(reading_time(path)) as gmsh, explained(path):
        draw(gmsh, path)
        names = solid_names(gmsh.model)
        boxes = {tag: np.array(gmsh.model.getBoundingBox(3, tag)).reshape(2, 3) for tag in names}
        solids = []
        for tag, name in names.items():
            volume, area = abs(gmsh.model.occ.getMass(3, tag)), _area(gmsh.model, tag)
            low, high = (tuple(float(x) for x in scale * corner) for corner in boxes[tag])
            wall = scale * 2.0 * volume / area if area else 0.0
            solids.append(Solid(name=name, volume=scale**3 * volume, low=low, high=high, wall=wall))  # pyright: ignore[reportArgumentType]
        touching = []
        for one, other in combinations(names, 2):
            near = NEAR * min(float(np.linalg.norm(np.ptp(boxes[tag], axis=0))) for tag in (one, other))
            if (boxes[one][0] > boxes[other][1] + near).any() or (boxes[other][0] > boxes[one][1] + near).any():
                continue
            allow(gmsh, _PAIR + reading_time(path))
            gap, *ends = gmsh.model.occ.getDistance(3, one, 3, other)
            if gap > near:
                continue
            gap = gap if gap > ROUNDING * near else 0.0
            at = 0.5 * np.add(ends[:3], ends[3:])
            depth, at = (0.0, at) if gap else _shared(gmsh.model, one, other, at)
            place: Any = tuple(float(scale * x) for x in at)
            pair = names[one], names[other]
            touching.append(Touch(solids=pair, gap=float(scale * gap), depth=float(scale * depth), at=place))
    return tuple(solids), tuple(touching)


def _area(model: Any, solid: int) -> float:
    """Of the faces of a solid, in the model's unit squared."""
    return sum(model.occ.getMass(2, abs(face)) for _, face in model.getBoundary([(3, solid)], oriented=False))


def _shared(model: Any, one: int, other: int, at: Array) -> tuple[float, Array]:
    """Mean thickness of what two solids share, and the point of it nearest to its middle, which a ring has outside.

    In the model's unit; 0 and `at` where they only touch.
    """
    found, _ = model.occ.intersect([(3, one)], [(3, other)], removeObject=False, removeTool=False)
    pieces = [tag for dim, tag in found if dim == 3]
    depth = 0.0
    if pieces:
        model.occ.synchronize()
        volume = {tag: abs(model.occ.getMass(3, tag)) for tag in pieces}
        greatest = max(volume, key=lambda tag: volume[tag])
        if volume[greatest] > 0.0:
            depth = 2.0 * volume[greatest] / _area(model, greatest)
            middle = model.occ.addPoint(*model.occ.getCenterOfMass(3, greatest))
            at = np.array(model.occ.getDistance(0, middle, 3, greatest)[4:])
            model.occ.remove([(0, middle)])
    if found:
        model.occ.remove(found, recursive=True)
        model.occ.synchronize()
    return depth, at
