"""Owns `register`, which adds a kind from outside the package to the table that scenes and model files read."""

from __future__ import annotations

from dataclasses import is_dataclass
from importlib import import_module
from typing import Any, NamedTuple, TypeVar

from warp_mca.base.errors import bad_value
from warp_mca.base.outside import note_registered
from warp_mca.base.validate import brief

Thing = TypeVar("Thing")

ELEMENT_PARTS = ("name", "cell", "patches", "lumped_masses", "eigenvalue_bounds", "largest_eigenvalues", "stage")
DATACLASS = "@dataclass(frozen=True, kw_only=True)"
RECORDER_PARTS = ("start", "frame", "history", "finish")


class Table(NamedTuple):
    """A table of kinds.

    Attributes:
        module, name: where it is; the module is imported when something is registered.
        base: module and class of which its entries are made; empty where `parts` decide.
        parts: attributes that its entries must have.
        whole: whether its entries are classes; False: objects with a `name`.
        data: whether these must be dataclasses, which model files and checkpoints can hold.
    """

    module: str
    name: str
    base: tuple[str, str] | None = None
    parts: tuple[str, ...] = ()
    whole: bool = True
    data: bool = False

    def takes(self, thing: object) -> bool:
        """Whether an object or class belongs into this table."""
        if isinstance(thing, type) != self.whole:
            return False
        if self.base is None:
            return not self.lacks(thing)
        base = getattr(import_module(self.base[0]), self.base[1])
        return issubclass(thing, base) if isinstance(thing, type) else isinstance(thing, base)

    def lacks(self, thing: object) -> list[str]:
        """Parts that an object or class does not have."""
        missing = [part for part in self.parts if not hasattr(thing, part)]
        return missing if is_dataclass(thing) or not self.data else [*missing, DATACLASS]

    def has_some(self, thing: object) -> bool:
        """Whether an object or class has one of the parts at least that tell what it is meant to be."""
        return any(hasattr(thing, part) for part in self.parts if part != "name")

    @property
    def entries(self) -> dict[str, Any]:
        """The table itself."""
        return getattr(import_module(self.module), self.name)

    @property
    def remedy(self) -> str:
        """What the table takes, in words."""
        if self.base is not None:
            return f"{'a class made of' if self.whole else 'an object of the class'} {'.'.join(self.base)}"
        parts = ", ".join([*self.parts, *self.data * [DATACLASS]])
        return f"{'a class' if self.whole else 'an object'} with {parts}"


# By the word that `kind` takes.
TABLES = {
    "material": Table("warp_mca.scene.materials", "MATERIALS", ("warp_mca.scene.materials", "Elastic")),
    "failure": Table("warp_mca.scene.failure", "FAILURES", ("warp_mca.scene.failure", "Failure")),
    "contact law": Table("warp_mca.scene.contact_laws", "CONTACT_LAWS", ("warp_mca.scene.contact_laws", "ContactLaw")),
    "friction law": Table(
        "warp_mca.scene.friction_laws", "FRICTION_LAWS", ("warp_mca.scene.friction_laws", "FrictionLaw")
    ),
    "joint": Table("warp_mca.scene.joints", "JOINTS", ("warp_mca.scene.joints", "Joint")),
    "load": Table("warp_mca.scene.loads", "LOADS", ("warp_mca.scene.loads", "Load")),
    "cell type": Table(
        "warp_mca.geometry.cell_types", "CELL_TYPES", ("warp_mca.geometry.cell_types", "CellType"), whole=False
    ),
    "element": Table("warp_mca.scene.elements", "ELEMENTS", parts=ELEMENT_PARTS, whole=False),
    "phase": Table("warp_mca.scene.phases", "PHASES", parts=("advance",), data=True),
    "recorder": Table("warp_mca.recorders", "RECORDERS", parts=RECORDER_PARTS),
}


def register(thing: Thing, *, kind: str | None = None) -> Thing:
    """Add a kind of what `TABLES` lists to those the package knows.

    Its name is that of its class, or its attribute `name` where the table holds objects (elements, cell types). It can
    be used as a decorator of a class. A class that is read again from the same module replaces itself.

    Args:
        thing: a class made of `scene.materials.Elastic`, `scene.failure.Failure`, `scene.contact_laws.ContactLaw`,
            `scene.friction_laws.FrictionLaw`, `scene.joints.Joint` or `scene.loads.Load`; a class with the methods of
            `recorders.Recorder`, or with the method `advance(impact, tell)` of a phase before the impact
            (`phases.stretch`); an object with the attributes of `physics.elements.Element`; a
            `geometry.cell_types.CellType`.
        kind: which of them it is, where that cannot be told from the object: a key of `TABLES`.

    Returns:
        `thing`.

    Raises:
        RequestError: it is none of these, or another one has its name.
    """
    if kind is not None and kind not in tuple(TABLES):
        raise bad_value("register.kind", brief(kind), f"choose among {', '.join(TABLES)}")
    asked = {name: table for name, table in TABLES.items() if kind in (None, name)}
    found = [name for name, table in asked.items() if table.takes(thing)]
    if len(found) != 1:
        near = {name: table for name, table in asked.items() if table.has_some(thing)} or asked
        wanted = "; ".join(f"as {name} {table.remedy}{_missing(table, thing)}" for name, table in near.items())
        raise bad_value("register", _words(thing), f"give {wanted}")
    entries = TABLES[found[0]].entries
    name = thing.__name__ if isinstance(thing, type) else thing.name  # pyright: ignore[reportAttributeAccessIssue]
    if not (isinstance(name, str) and name):
        raise bad_value(f"register: name of the {found[0]}", brief(name), "give a text that is not empty")
    other = entries.get(name)
    if other is not None and other is not thing and not _read_again(other, thing):
        remedy = f"{_words(other)} has this name; give {_words(thing)} another one"
        raise bad_value(f"register: name of the {found[0]}", name, remedy)
    entries[name] = thing
    note_registered(name)
    return thing


def _missing(table: Table, thing: object) -> str:
    lacks = table.lacks(thing) if table.has_some(thing) else []
    return f" (this lacks {', '.join(lacks)})" if lacks else ""


def _read_again(other: object, thing: object) -> bool:
    """Whether a thing is one that was registered before, from a module outside the package that was read again."""
    if other == thing:
        return True
    place, _ = _place(other)
    return _place(other) == _place(thing) and not place.startswith("warp_mca.")


def _place(thing: object) -> tuple[str, str]:
    """Module and name of the class of a thing, or of the class that it is."""
    kind = thing if isinstance(thing, type) else type(thing)
    return kind.__module__, kind.__qualname__


def _words(thing: object) -> object:
    return ".".join(_place(thing)) if isinstance(thing, type) or hasattr(thing, "name") else brief(thing)
