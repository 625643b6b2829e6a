"""Owns the history of each contact (forces.npz), and its figures in the summary."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.results.force_history import FIRM, GRAZING, contact_intervals, grazing_share, unfinished
from warp_mca.results.npz import load_histories, save_histories
from warp_mca.scene import Contact, RigidPlane

Array = NDArray[np.float64]

ONE_WAY = 0.1  # least share of the normal forces that their vector sum keeps, for them to have a direction
_COLUMNS = {  # arrays of forces.npz, and the attributes of `ContactHistory` that they hold
    "force_N": "force",
    "pressure_N": "pressure",
    "normal_force_N": "normal_force",
    "closing_speed": "closing_speed",
}
LIGHT = 0.05  # of its greatest force: a contact nearly opens below it, between forces above FIRM
OFF_AXIS = 10.0  # degrees between the normal of a contact and the axis of F_n, above which a run warns
ACROSS = 0.02  # of the normal impulse, above which friction across the axis of F_t is worth a word
ALONG = 0.99  # cosine from which on an axis is taken as that of a plane of symmetry


@dataclass(frozen=True, kw_only=True)
class ContactHistory:
    """One contact of the scene in every output interval. Forces act on the slave; those of both passes count.

    Attributes:
        name: of the contact, see `contact_names`.
        force: whole force, mean over the interval [N], shape (row_count, 3), float64.
        pressure: normal forces of all slave nodes, added up as they are, mean over the interval [N], shape
            (row_count,), float64.
        normal_force: vector sum of the normal forces at the end of the interval [N], shape (row_count, 3), float64.
        closing_speed: speed at which the touching surfaces approach each other along their normal, mean over the
            interval and over the nodes that touch, weighted with their normal forces [m/s], shape (row_count,),
            float64; negative while they part, nan where nothing touched and in the first row.
    """

    name: str
    force: Array
    pressure: Array
    normal_force: Array
    closing_speed: Array

    def at(self, rows: NDArray[np.integer] | NDArray[np.bool_]) -> ContactHistory:
        """The same in some output intervals: their numbers, shape (count,), or whether each is, shape (row_count,)."""
        return ContactHistory(
            name=self.name,
            force=self.force[rows],
            pressure=self.pressure[rows],
            normal_force=self.normal_force[rows],
            closing_speed=self.closing_speed[rows],
        )

    @property
    def normal(self) -> Array | None:
        """Direction of the normal impulse on the slave [-], shape (3,), or None where it has none.

        It has none without contact, and where normal forces cancel, as around a clamped body.
        """
        total = self.normal_force.sum(axis=0)
        size, most = np.linalg.norm(total), np.linalg.norm(self.normal_force, axis=1).sum()
        return total / size if size > ONE_WAY * most else None

    @property
    def touched(self) -> bool:
        """Whether the surfaces pressed on each other."""
        return bool(self.pressure.max(initial=0.0) > 0.0)

    @property
    def unfinished(self) -> bool:
        """Whether the contact was still in progress in the last row."""
        return unfinished(self.pressure)

    def summary(self, time: Array) -> dict[str, Any]:
        """What `contacts_by_pair` of the summary says of it.

        Args:
            time: ends of the output intervals [s], shape (row_count,).
        """
        size = np.linalg.norm(self.force, axis=1)
        step = float(time[1] - time[0]) if len(time) > 1 else 0.0
        return {
            "name": self.name,
            "intervals": [list(span) for span in contact_intervals(time, self.pressure)],
            "contact_open_at_end": self.unfinished,
            "F_max": self.force[int(np.argmax(size))].tolist() if len(size) else [0.0, 0.0, 0.0],
            "impulse": (step * self.force.sum(axis=0)).tolist(),
            "normal": None if self.normal is None else self.normal.tolist(),
        }


def contact_names(contacts: Sequence[Contact]) -> tuple[str, ...]:
    """A name for each contact: its own, or "slave–master" by their bodies, numbered from the second of a pair on."""
    taken = {contact.name for contact in contacts if contact.name is not None}
    names: list[str] = []
    for contact in contacts:
        name = contact.name
        if name is None:
            master = "plane" if isinstance(contact.master, RigidPlane) else contact.master.body
            pair = f"{contact.slave.body}–{master}"
            numbered = (pair if k == 1 else f"{pair} {k}" for k in range(1, len(contacts) + 1))
            name = next(text for text in numbered if text not in taken)
            taken.add(name)
        names.append(name)
    return tuple(names)


def contact_warnings(
    contacts: Sequence[ContactHistory], axes: Array, symmetry: Mapping[int, Array] | None = None
) -> list[str]:
    """Warnings about contacts: none touched, some did not end, nearly opened or grazed, normals are off the axes.

    Args:
        contacts: of the scene.
        axes: as `Model.contact_axes`.
        symmetry: normals of planes that contacts lie in [-], by contact, shape (plane_count, 3): forces along these are
            cancelled by what lies beyond.
    """
    found: list[str] = []
    if contacts and not any(contact.touched for contact in contacts):
        found.append("no contact closed in the simulated time: give a longer duration, or check positions and speeds")
    if names := [contact.name for contact in contacts if contact.unfinished]:
        which = f"contact {names[0]} was" if len(names) == 1 else f"contacts {', '.join(names)} were"
        found.append(
            f"{which} still in progress when the run ended: impulse, duration and peaks are those so far; give a "
            "longer duration if it should end"
        )
    for k, (contact, (normal, tangent)) in enumerate(zip(contacts, axes, strict=True)):
        cancelled = (symmetry or {}).get(k, np.zeros((0, 3)))
        found += _nearly_opens(contact)
        found += _grazes(contact)
        if contact.normal is not None:
            off = _off_axis(contact.name, contact.normal, normal, tangent)
            found += off or _across(contact, contact.normal, tangent, cancelled)
    return found


def _nearly_opens(contact: ContactHistory) -> list[str]:
    """A warning where a contact hardly presses between two compressions: another mesh may open it there."""
    share = contact.pressure / max(float(contact.pressure.max(initial=0.0)), 1e-300)
    firm, light = np.flatnonzero(share > FIRM), np.flatnonzero(share <= LIGHT)
    before = np.searchsorted(firm, light)  # firm rows before each light one: 0 and all are no dips
    dips = [float(share[light[before == k]].min()) for k in np.unique(before) if 0 < k < len(firm)]
    if not any(least := [dip for dip in dips if dip > 0.0]):
        return []
    return [
        f"contact {contact.name} nearly opened between two compressions, with {min(least):.1%} of its greatest force: "
        "whether it opens there may depend on the mesh, and with it duration and impulse; compare with a finer one"
    ]


def _grazes(contact: ContactHistory) -> list[str]:
    """A warning where surfaces touch again and hardly press: whether they do, and how long, is the mesh's."""
    if not (share := grazing_share(contact.pressure)):
        return []
    return [
        f"for {share:.0%} of its time, contact {contact.name} has less than {GRAZING:.0%} of its greatest force in "
        "touches of their own: whether these occur, and how long they last, depends on the mesh, and contact_duration "
        "counts them; contacts in summary.json has each"
    ]


def _off_axis(name: str, true: Array, normal: Array, tangent: Array) -> list[str]:
    """A warning where the `true` normal of a contact is off its axes [-], each shape (3,); `normal` may be 0."""
    if normal.any():
        column, axis, angle = "F_n_N", normal, math.degrees(math.acos(np.clip(true @ normal, -1.0, 1.0)))
    else:  # normal forces add up as they are; tangential force must not hold some of them
        column, axis, angle = "F_t_N", tangent, math.degrees(math.asin(min(abs(true @ tangent), 1.0)))
    if angle <= OFF_AXIS:
        return []
    seen, along = (", ".join(f"{x:.3g}" for x in vector) for vector in (true, axis))
    off = f"{angle:.0f} degrees off the axis ({along}) of" if normal.any() else f"not across the axis ({along}) of"
    return [
        f"contact {name}: its normal force is along ({seen}), {off} {column}; set Contact.normal and tangent, or read "
        "the force vectors in forces.npz"
    ]


def _across(contact: ContactHistory, normal: Array, tangent: Array, cancelled: Array) -> list[str]:
    """A warning where friction acts across the tangent rather than along it; axes [-], each shape (3,).

    Not where it is `cancelled`, see `contact_warnings`.
    """
    side = np.cross(normal, tangent)
    if (np.abs(cancelled @ side) > ALONG).any():
        return []
    along, across = np.abs(contact.force @ tangent).sum(), np.abs(contact.force @ side).sum()
    across -= np.abs(contact.normal_force @ side).sum()  # what pressure on a curved surface has there
    if across <= max(along, ACROSS * contact.pressure.sum()):
        return []
    seen, axis = (", ".join(f"{x:.3g}" for x in vector + 0.0) for vector in (side, tangent))
    return [
        f"contact {contact.name}: its friction is along ({seen}), across the axis ({axis}) of F_t_N; set "
        "Contact.tangent, or read the force vectors in forces.npz"
    ]


def save_contacts(file: Path, time: Array, contacts: Sequence[ContactHistory]) -> None:
    """Write time_s, and for each contact NAME/force_N and the other arrays of `ContactHistory`, as an npz archive."""
    columns = {contact.name: {key: getattr(contact, field) for key, field in _COLUMNS.items()} for contact in contacts}
    save_histories(file, time, columns)


def load_contacts(file: str | os.PathLike[str]) -> tuple[ContactHistory, ...]:
    """The contacts that `save_contacts` wrote."""
    found = load_histories(file, *_COLUMNS)
    return tuple(
        ContactHistory(name=name, **dict(zip(_COLUMNS.values(), columns, strict=True)))
        for name, columns in found.items()
    )
