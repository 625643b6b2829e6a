"""Owns `Assembly`: the solids of a CAD file as bodies of a scene, glued, tied or in contact with each other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field, replace
from fnmatch import fnmatchcase
from functools import cached_property
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.scene.bodies import Body
from warp_mca.scene.bonds import Bond
from warp_mca.scene.contacts import Contact, ContactAll, Surface
from warp_mca.scene.materials import Material

if TYPE_CHECKING:
    from warp_mca.geometry.cad_solids import Solid, Touch

Join = str | Bond  # one of JOINS, or a bond that fails
JOINS = ("glue", "tie", "contact", "apart")
_HEALED = 2.0  # of the greatest gap or overlap of solids that are glued: faces as near count as one [-]
_THIN = 0.05  # of the thinnest wall of these solids: no faces farther apart do [-]
_SPANNED, _FACE = 1.5, 0.25  # times a gap that ties span, small edges of faces over the size of cells [-]
_MOST = 0.5  # of the edge of a face: ties span no more [-]
_LEAST = 1e-9  # distance within which faces always do [m]


@dataclass(frozen=True)
class Assembly:
    """The solids of a STEP, IGES or BREP file as bodies, in their places there; each instance of a part is one.

    Names are those of the file; further solids of a name are "name_2", "name_3", .... Give a scene `bodies` and
    `contacts`:

        phone = mca.Assembly("phone.step", materials={"shell": mca.library.ABS, "*": mca.library.ALUMINIUM_6061_T6})
        scene = mca.Scene(name="phone", bodies=phone.bodies, contacts=phone.contacts, ...)

    Names in `materials`, `size` and `join` may be patterns, as "chip*"; the first that fits counts, "*" last of all.

    Attributes:
        path: of the file.
        materials: of the solids, by name.
        size: greatest edge of the ten-node tetrahedra [m], or one by name; None takes it from the walls, see `Cad`.
        across: tetrahedra over a wall where there is no size [-].
        join: how solids that touch hold together, by pairs of names, or by a name for all that this solid touches.
            "contact", the default: they press and slide. "glue": they share the nodes of their common face and become
            one body "a+b", with a cell set for each solid. "tie": meshes of their own that no force parts (`Bond`
            without strength). A `Bond` fails at its strength. "apart": they pass through each other.
        scale: metres for one unit of the file, as in `Cad`.
        mu: coefficient of friction between solids [-].
    """

    path: str | Path
    _: KW_ONLY
    materials: Mapping[str, Material]
    size: float | Mapping[str, float] | None = None
    across: float = 2.0
    join: Mapping[Any, Join] = field(default_factory=dict)
    scale: float | None = None
    mu: float = 0.0

    def __post_init__(self) -> None:
        from warp_mca.geometry.cad import Cad

        validate.plain(self)
        Cad(self.path, scale=self.scale, across=self.across)  # which checks them
        if Path(self.path).suffix.lower() == ".stl":
            raise bad_value("Assembly.path", str(self.path), "an STL file holds one solid; give it to a Cad")
        for name in ("materials", "join"):
            validate.kinds("Assembly", Mapping, "give a dict by names of solids", **{name: getattr(self, name)})
        for key, how in self.join.items():
            pair = isinstance(key, tuple) and len(key) == 2 and all(isinstance(name, str) for name in key)
            if not (pair or isinstance(key, str)):
                raise bad_value(
                    "Assembly.join", validate.brief(key), 'give names of solids, as "lid" or ("lid", "box")'
                )
            if not isinstance(how, Bond) and how not in JOINS:
                raise bad_value(f"Assembly.join[{key!r}]", validate.brief(how), f"choose {', '.join(JOINS)} or a Bond")
        sizes = self.size.values() if isinstance(self.size, Mapping) else (self.size,)
        for size in sizes:
            if size is not None:
                validate.within("Assembly", 1e-12, 1e6, size=size)

    @cached_property
    def _read(self) -> tuple[list[Solid], list[Touch]]:
        from warp_mca.geometry.cad_drawing import file_stamp
        from warp_mca.geometry.cad_solids import inspected

        return inspected(self.path, self.scale, file_stamp(self.path))

    @property
    def names(self) -> tuple[str, ...]:
        """Of the solids, in the order of the file."""
        return tuple(solid.name for solid in self._read[0])

    @property
    def touching(self) -> tuple[Touch, ...]:
        """Pairs of solids that touch, with gap or overlap [m] and place [m]."""
        return tuple(self._read[1])

    @cached_property
    def bodies(self) -> tuple[Body, ...]:
        """A body for each solid, or for each group of solids that are glued.

        Raises:
            RequestError: gmsh cannot read the file; a solid has no material, or a name fits none.
        """
        self._check_names()
        return tuple(self._body(group) for group in self._groups)

    @cached_property
    def contacts(self) -> tuple[Contact | ContactAll, ...]:
        """General contact, and a contact for each tied pair; solids that overlap in the file start free of stress.

        Raises:
            RequestError: as in `bodies`; several solids of two glued bodies touch and are not joined alike.
        """
        apart, listed = [], []
        for one, other in combinations(self._groups, 2):
            found = [self._joins[t] for t in self.touching if _between(t, one, other)]
            if not found:
                continue
            if any(how != found[0] for how in found):
                remedy = f"solids of {'+'.join(one)} and {'+'.join(other)} touch at several places; join all alike"
                raise bad_value("Assembly.join", found, remedy)
            if found[0] == "apart":
                apart.append(("+".join(one), "+".join(other)))
            elif found[0] != "contact":
                bond = self._spanning(found[0] if isinstance(found[0], Bond) else Bond(), one, other)
                finer, coarser = sorted((one, other), key=self._fineness)
                slave, master = (Surface(body="+".join(group), nodes="boundary") for group in (finer, coarser))
                listed.append(Contact(slave=slave, master=master, mu=self.mu, initial_overlap="stress_free", bond=bond))
        everything = ContactAll(mu=self.mu, initial_overlap="stress_free", exclude=tuple(apart))
        return (everything, *listed)

    @cached_property
    def _joins(self) -> dict[Touch, Join]:
        """How each pair that touches holds together.

        Raises:
            RequestError: an entry of `join` fits no pair.
        """
        found: dict[Touch, Join] = {}
        for touch in self.touching:
            fitting = [key for key in self.join if _fits(key, touch)]
            found[touch] = self.join[min(fitting, key=_is_rest)] if fitting else "contact"
        for key in self.join:
            if not any(_fits(key, touch) for touch in self.touching):
                from warp_mca.geometry.cad_solids import NEAR  # which imports gmsh's readers

                pairs = "; ".join(touch.text for touch in self.touching) or "none do"
                near = f"solids with gaps up to {NEAR:.1%} of the smaller one do"
                raise bad_value("Assembly.join", key, f"no such solids touch ({pairs}; {near}); correct the names")
        return found

    @cached_property
    def _groups(self) -> list[tuple[str, ...]]:
        """Names of the solids of each body.

        Raises:
            RequestError: solids of a group touch that are not to be glued.
        """
        group = {name: {name} for name in self.names}
        for touch, how in self._joins.items():
            if how == "glue":
                one, other = (group[name] for name in touch.solids)
                for name in other:
                    group[name] = one
                one |= other
        for touch, how in self._joins.items():
            one, other = touch.solids
            if how != "glue" and group[one] is group[other]:
                remedy = f"{one} and {other} touch, and both are glued to others; glue this pair as well"
                raise bad_value("Assembly.join", how, remedy)
        return list(dict.fromkeys(tuple(n for n in self.names if n in group[name]) for name in self.names))

    def _body(self, group: tuple[str, ...]) -> Body:
        from warp_mca.geometry.cad import Cad

        own = [touch for touch in self.touching if set(touch.solids) <= set(group)]
        glue = None
        if own:
            thinnest = min(solid.wall for solid in self._read[0] if solid.name in group)
            worst = max(max(touch.gap, touch.depth) for touch in own)
            glue = max(_LEAST, min(_HEALED * worst, _THIN * thinnest))
        notes = [
            f"{touch.text} in {Path(self.path).name}"
            for touch in self.touching
            if touch.solids[0] in group and (touch.gap or touch.depth)
        ]
        sizes = [size for name in group if (size := self._size(name)) is not None]
        geometry = Cad(
            str(self.path),  # as model files store it
            size=min(sizes, default=None),
            scale=self.scale,
            across=self.across,
            solids=group,
            glue=glue,
            notes=tuple(notes),
        )
        materials = {name: self._material(name) for name in group}
        one = len(set(map(id, materials.values()))) == 1
        return Body(
            name="+".join(group),
            geometry=geometry,
            material=materials[group[0]] if one else materials,
            kinematics="finite" if any(material.finite_only for material in materials.values()) else "corotational",
        )

    def _spanning(self, bond: Bond, one: tuple[str, ...], other: tuple[str, ...]) -> Bond:
        """A bond of two bodies that spans the gap or overlap between them, on the smallest faces too."""
        worst = max(max(touch.gap, touch.depth) for touch in self.touching if _between(touch, one, other))
        face = _FACE * min(self._fineness(group)[0] for group in (one, other))
        return replace(bond, gap=max(bond.gap, min(_SPANNED * worst / face, _MOST)))

    def _size(self, name: str) -> float | None:
        if not isinstance(self.size, Mapping):
            return self.size
        key = _chosen(name, self.size)
        return None if key is None else self.size[key]

    def _material(self, name: str) -> Material:
        key = _chosen(name, self.materials)
        if key is None:
            raise bad_value("Assembly.materials", list(self.materials), f'give a material for {name}, or for "*"')
        return self.materials[key]

    def _fineness(self, group: tuple[str, ...]) -> tuple[float, float]:
        """Size of the cells of a body and its volume: the lesser one is tied to the greater."""
        solids = [solid for solid in self._read[0] if solid.name in group]
        size = min(self._size(solid.name) or solid.wall / self.across for solid in solids)
        return size, sum(solid.volume for solid in solids)

    def _check_names(self) -> None:
        """Raise RequestError where a name of `materials` or `size` fits no solid."""
        for field_name in ("materials", "size"):
            given = getattr(self, field_name)
            for key in given if isinstance(given, Mapping) else ():
                if not any(fnmatchcase(name, key) for name in self.names):
                    remedy = f"the file has {', '.join(self.names)}; correct the name, or leave it out"
                    raise bad_value(f"Assembly.{field_name}", key, remedy)


def _chosen(name: str, given: Mapping[str, object]) -> str | None:
    """The name or pattern that counts for a solid."""
    if name in given:
        return name
    return min((key for key in given if fnmatchcase(name, key)), key=_is_rest, default=None)


def _is_rest(key: str | tuple[str, str]) -> bool:
    return set(key) == {"*"}


def _fits(key: str | tuple[str, str], touch: Touch) -> bool:
    """Whether a key of `Assembly.join` means a pair."""
    one, other = touch.solids
    if isinstance(key, str):
        return fnmatchcase(one, key) or fnmatchcase(other, key)
    first, second = key
    return any(fnmatchcase(a, first) and fnmatchcase(b, second) for a, b in ((one, other), (other, one)))


def _between(touch: Touch, one: tuple[str, ...], other: tuple[str, ...]) -> bool:
    """Whether a pair has a solid in each of two groups."""
    a, b = touch.solids
    return (a in one and b in other) or (a in other and b in one)
