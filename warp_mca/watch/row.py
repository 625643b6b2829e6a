"""Owns a row of the table of guards, warnings and advice, and what its conditions look at."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from typing import TYPE_CHECKING, Any

from warp_mca.base.arrays import Array
from warp_mca.scene import Contact, ContactAll, RigidPlane

if TYPE_CHECKING:
    from warp_mca.geometry.mesh import Mesh
    from warp_mca.results.contact_history import ContactHistory
    from warp_mca.rigid.handoff import HandOff
    from warp_mca.scene import Scene
    from warp_mca.system.contact import ContactPass
    from warp_mca.system.model import Model
    from warp_mca.system.rigid import RigidExtremes
    from warp_mca.watch.ledger import Ledger
    from warp_mca.watch.passing import Watch

Values = Mapping[str, object]  # that fill the places of a sentence
Condition = Callable[[Any, float], Iterable[Values]]


class Kind(StrEnum):
    """What a row does."""

    GUARD = "guard"  # stops the run: what comes later would be wrong
    WARNING = "warning"  # some figures are less sure than they look
    ADVICE = "advice"  # the scene may not be what was meant, or can be had cheaper


class When(StrEnum):
    """When a row is looked at."""

    BEFORE = "before the run"
    FLAGS = "at flags of kernels, before the records count"
    RECORDS = "at records"
    LOOKS = "at looks, told at the end"
    END = "at the end"


@dataclass(frozen=True)
class Row:
    """A guard, a warning or a piece of advice.

    Attributes:
        sentence: what was found, with places as of `str.format`.
        remedy: what to change, likewise; it follows the sentence.
        limit: threshold of the condition, in `unit`; not used where the unit is empty.
        unit: of the limit, and further numbers of the condition.
        kind, when: as these say.
        found: the condition: of a `Context` (of `Finished` at the end, of `Reading` at records) and the limit, the
            values for the places of the sentence, once for each time that it is to be told. Its docstring says what it
            looks at.
    """

    sentence: str
    remedy: str
    limit: float
    unit: str
    kind: Kind
    when: When
    found: Condition

    @property
    def name(self) -> str:
        """That of the condition, in words."""
        return self.found.__name__.replace("_", " ")

    def told(self, context: object) -> list[str]:
        """The sentences that the context gives reason for."""
        text = f"{self.sentence} {self.remedy}".rstrip()
        return [text.format(**values) for values in self.found(context, self.limit)]


def row(
    sentence: str,
    remedy: str = "",
    limit: float = 0.0,
    unit: str = "",
    kind: Kind = Kind.WARNING,
    when: When = When.END,
) -> Callable[[Condition], Row]:
    """Makes a row of the condition that follows."""
    return partial(Row, sentence, remedy, limit, unit, kind, when)


@dataclass(frozen=True, kw_only=True)
class Context:
    """What is known before the run.

    Attributes:
        scene: that is run.
        meshes: of its bodies, by name.
        model: assembled of them, of this scene alone.
    """

    scene: Scene
    meshes: Mapping[str, Mesh]
    model: Model

    def nodes(self, body: str) -> slice:
        """Nodes of a body in the model."""
        first = self.model.node_start[body]
        return slice(first, first + len(self.meshes[body].points))


@dataclass(frozen=True, kw_only=True)
class SpringShare:
    """Share of the exchanged energy that springs of a contact hold, and the loss of its force peak by that [-].

    Attributes:
        share: of the energy; where an interference loads the contact at rest, of that which it stores.
        loss: of the force.
        rest: whether an interference loads the contact at rest, as a press fit or heat does.
        where: what bears it, "edges" and corners, or "flat" faces that strike; empty for anything else.
    """

    share: float
    loss: float
    rest: bool = False
    where: str = ""


@dataclass(frozen=True, kw_only=True)
class Finished(Context):
    """What is known at the end of the impact phase, or where a guard stopped it.

    Attributes:
        start: of the impact phase.
        ledger: rows and energy balance.
        steps_taken: since the start of the phase [-].
        u: displacements of the nodes [m], shape (node_count, 3), float64.
        v: their velocities [m/s], shape (node_count, 3), float64.
        depths: of each contact pass, largest penetration of each spring [m], shape (spring_count,), float64.
        bent: energies of bodies [J], as `SceneRecords.stiffened` has them, shape (body_count, COLUMNS), float64.
        history: columns of history.csv, each shape (row_count,), float64.
        contacts: histories of the scene's contacts.
        shares: energy in the springs of each contact, see `spring_shares`; None without force.
        watch: what may go into each other.
        stopped: whether a guard stopped the run.
        origin: when the times that are told begin [s].
        peaks: of each body by name, as `bodies` in the summary has them.
        rigid: extremes of rigid bodies and their joints; None without such bodies.
    """

    start: HandOff
    ledger: Ledger
    steps_taken: int
    u: Array
    v: Array
    depths: Sequence[Array]
    bent: Array
    history: Mapping[str, Array]
    contacts: Sequence[ContactHistory]
    shares: Mapping[str, SpringShare | None]
    watch: Watch
    stopped: bool
    origin: float
    peaks: Mapping[str, Mapping[str, Any]]
    rigid: RigidExtremes | None = None


def listed_passes(scene: Scene, model: Model) -> Iterator[tuple[int, ContactPass, Contact]]:
    """Passes of listed contacts: their number, what they are and the contact that they belong to."""
    for k, item in enumerate(model.passes):
        contact = scene.contacts[item.contact]
        if isinstance(contact, Contact):
            yield k, item, contact


def sides_of(contact: Contact | ContactAll) -> list[str]:
    """Bodies of a listed contact, the slave first."""
    if isinstance(contact, ContactAll):
        return []
    return [contact.slave.body, *([] if isinstance(contact.master, RigidPlane) else [contact.master.body])]
