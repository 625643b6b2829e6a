"""Owns `register`, which adds a kind from outside the package to the table that scenes and model files read."""

from __future__ import annotations

from importlib import import_module
from typing import Any, NamedTuple, TypeVar

from warp_mca.base.errors import bad_value
from warp_mca.base.validate import brief

Thing = TypeVar("Thing")

ELEMENT_PARTS = ("name", "cell", "patches", "lumped_masses", "eigenvalue_bounds", "largest_eigenvalues", "stage")
RECORDER_PARTS = ("start", "frame", "history", "finish")


class Table(NamedTuple):
    """A table of kinds.

    Attributes:
        module, name: where it is; the module is imported when something is registered.
        base: module and class of which its entries are made; empty where `parts` decide.
        parts: attributes that its entries must have.
        whole: whether its entries are classes; False: objects with a `name`.
    """

    module: str
    name: str
    base: tuple[str, str] | None = None
    parts: tuple[str, ...] = ()
    whole: bool = True

    def takes(self, thing: object) -> bool:
        """Whether an object or class belongs into this table."""
        if isinstance(thing, type) != self.whole:
            return False
        if self.base is None:
            return all(hasattr(thing, part) for part in self.parts)
        base = getattr(import_module(self.base[0]), self.base[1])
        return issubclass(thing, base) if isinstance(thing, type) else isinstance(thing, base)

    @property
    def entries(self) -> dict[str, Any]:
        """The table itself."""
        return getattr(import_module(self.module), self.name)

    @property
    def remedy(self) -> str:
        """What the table takes, in words."""
        if self.base is not None:
            return f"{'a class made of' if self.whole else 'an object of the class'} {'.'.join(self.base)}"
        return f"{'a class' if self.whole else 'an object'} with {', '.join(self.parts)}"


# By the word that `kind` takes.
TABLES = {
    "material": Table("warp_mca.scene.materials", "MATERIALS", ("warp_mca.scene.materials", "Elastic")),
    "contact law": Table("warp_mca.scene.contact_laws", "CONTACT_LAWS", ("warp_mca.scene.contact_laws", "ContactLaw")),
    "joint": Table("warp_mca.scene.joints", "JOINTS", ("warp_mca.scene.joints", "Joint")),
    "load": Table("warp_mca.scene.loads", "LOADS", ("warp_mca.scene.loads", "Load")),
    "cell type": Table(
        "warp_mca.geometry.cell_types", "CELL_TYPES", ("warp_mca.geometry.cell_types", "CellType"), whole=False
    ),
    "element": Table("warp_mca.scene.elements", "ELEMENTS", parts=ELEMENT_PARTS, whole=False),
    "recorder": Table("warp_mca.recorders", "RECORDERS", parts=RECORDER_PARTS),
}


def register(thing: Thing, *, kind: str | None = None) -> Thing:
    """Add a material, contact law, load, joint, cell type, element or recorder to those that the package knows.

    Its name is that of its class, or its attribute `name` where the table holds objects (elements, cell types). It can
    be used as a decorator of a class. A class that is read again from the same module replaces itself.

    Args:
        thing: a class made of `scene.materials.Elastic`, `scene.contact_laws.ContactLaw`, `scene.loads.Load` or
            `scene.joints.Joint`; a class with the methods of `recorders.Recorder`; an object with the attributes of
            `physics.elements.Element`; a `geometry.cell_types.CellType`.
        kind: which of them it is, where that cannot be told from the object: a key of `TABLES`.

    Returns:
        `thing`.

    Raises:
        RequestError: it is none of these, or another one has its name.
    """
    if kind is not None and kind not in TABLES:
        raise bad_value("register.kind", brief(kind), f"choose among {', '.join(TABLES)}")
    found = [name for name, table in TABLES.items() if kind in (None, name) and table.takes(thing)]
    if len(found) != 1:
        wanted = "; ".join(f"as {name} {table.remedy}" for name, table in TABLES.items() if kind in (None, name))
        raise bad_value("register", _words(thing), f"give {wanted}")
    entries = TABLES[found[0]].entries
    name = thing.__name__ if isinstance(thing, type) else thing.name  # pyright: ignore[reportAttributeAccessIssue]
    if not (isinstance(name, str) and name):
        raise bad_value(f"register: name of the {found[0]}", brief(name), "give a text that is not empty")
    other = entries.get(name)
    if other is not None and other is not thing and _place(other) != _place(thing):
        remedy = f"{_words(other)} has this name; give {_words(thing)} another one"
        raise bad_value(f"register: name of the {found[0]}", name, remedy)
    entries[name] = thing
    return thing


def _place(thing: object) -> tuple[str, str]:
    """Module and name of the class of a thing, or of the class that it is."""
    kind = thing if isinstance(thing, type) else type(thing)
    return kind.__module__, kind.__qualname__


def _words(thing: object) -> object:
    return ".".join(_place(thing)) if isinstance(thing, type) or hasattr(thing, "name") else brief(thing)
