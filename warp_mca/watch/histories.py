"""Owns the rows about the history of each contact: whether it closed and opened, and whether its axes are right."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.results.force_history import FIRM, GRAZING, grazing_share
from warp_mca.watch.contacts import symmetry_of
from warp_mca.watch.row import Array, Finished, Values, row

if TYPE_CHECKING:
    from warp_mca.results.contact_history import ContactHistory

ACROSS = 0.02  # of the normal impulse, above which friction across the axis of F_t is worth a word
OFF_AXIS = 10.0  # degrees
ALONG = 0.99  # cosine from which on an axis is taken as that of a plane of symmetry


@row("no contact closed in the simulated time:", "give a longer duration, or check positions and speeds")
def no_contact(c: Finished, _: float) -> Iterator[Values]:
    """Whether any contact of a scene with contacts was touched, but of a general one beside bonds."""
    contacts = _loose(c, safety_net=False)
    if contacts and not any(contact.touched for contact in contacts):
        yield {}


@row(
    "{which} still in progress when the run ended: impulse, duration and peaks are those so far;",
    "give a longer duration if it should end",
)
def unfinished_contact(c: Finished, _: float) -> Iterator[Values]:
    """Contacts that press in the last row."""
    if names := [contact.name for contact in _loose(c) if contact.unfinished]:
        yield dict(which=f"contact {names[0]} was" if len(names) == 1 else f"contacts {', '.join(names)} were")


@row(
    "contact {name} nearly opened between two compressions, with {share:.1%} of its greatest force: whether it opens "
    "there may depend on the mesh, and with it duration and impulse;",
    "compare with a finer one",
    0.05,
    f"of its greatest force at least, between forces above {FIRM:g} of it",
)
def nearly_opened(c: Finished, least: float) -> Iterator[Values]:
    """Least force of each contact between two compressions: another mesh may open it there."""
    for contact in _loose(c):
        share = contact.pressure / max(float(contact.pressure.max(initial=0.0)), 1e-300)
        firm, light = np.flatnonzero(share > FIRM), np.flatnonzero(share <= least)
        before = np.searchsorted(firm, light)  # firm rows before each light one: 0 and all are no dips
        dips = [float(share[light[before == k]].min()) for k in np.unique(before) if 0 < k < len(firm)]
        if found := [dip for dip in dips if dip > 0.0]:
            yield dict(name=contact.name, share=min(found))


@row(
    "for {share:.0%} of its time, contact {name} has less than {grazing:.0%} of its greatest force in touches of their "
    "own: whether these occur, and how long they last, depends on the mesh, and contact_duration counts them;",
    "contacts in summary.json has each",
    GRAZING,
    "of its greatest force at least",
)
def grazing_touch(c: Finished, least: float) -> Iterator[Values]:
    """Force of further touches of each contact: whether they occur, and how long, is the mesh's."""
    for contact in _loose(c):
        if share := grazing_share(contact.pressure):
            yield dict(name=contact.name, share=share, grazing=least)


@row(
    "contact {name}: its normal force is along ({seen}), {off} {column};",
    "set Contact.normal and tangent, or read the force vectors in forces.npz",
    OFF_AXIS,
    "degrees at most",
)
def normal_off_its_axis(c: Finished, most: float) -> Iterator[Values]:
    """Angle between each contact's normal and the axis of F_n; of closed masters, to the plane across that of F_t."""
    for _, contact, normal, tangent in _reported(c):
        angle = _off_axis(contact, normal, tangent)
        if contact.normal is None or angle <= most:
            continue
        seen, along = (_listed(vector) for vector in (contact.normal, normal if normal.any() else tangent))
        off = f"{angle:.0f} degrees off the axis ({along}) of" if normal.any() else f"not across the axis ({along}) of"
        yield dict(name=contact.name, seen=seen, off=off, column="F_n_N" if normal.any() else "F_t_N")


@row(
    "contact {name}: its friction is along ({seen}), across the axis ({axis}) of F_t_N;",
    "set Contact.tangent, or read the force vectors in forces.npz",
    1.0,
    f"times the friction along the axis at most; {ACROSS:g} of the normal impulse",
)
def friction_across_the_tangent(c: Finished, most: float) -> Iterator[Values]:
    """Friction of each contact across the axis of F_t, without what symmetry cancels or pressure gives there."""
    symmetry = symmetry_of(c.model)
    for k, contact, normal, tangent in _reported(c):
        if contact.normal is None or _off_axis(contact, normal, tangent) > OFF_AXIS:
            continue
        side = np.cross(contact.normal, tangent)
        if k in symmetry and (np.abs(symmetry[k] @ side) > ALONG).any():
            continue
        along, across = np.abs(contact.force @ tangent).sum(), np.abs(contact.force @ side).sum()
        across -= np.abs(contact.normal_force @ side).sum()
        if across > max(most * along, ACROSS * contact.pressure.sum()):
            yield dict(name=contact.name, seen=_listed(side + 0.0), axis=_listed(tangent + 0.0))


def _reported(c: Finished) -> Iterator[tuple[int, ContactHistory, Array, Array]]:
    """Contacts that F_n_N and F_t_N count: their place, and their axes, each shape (3,)."""
    internal = {item.contact for item in c.model.passes if item.internal}
    for k, (contact, axes) in enumerate(zip(c.contacts, c.model.contact_axes, strict=True)):
        if k not in internal:
            yield k, contact, *axes


def _loose(c: Finished, safety_net: bool = True) -> list[ContactHistory]:
    """Contacts without a bond, which holds nodes whether they press or not; beside bonds a general one is a net."""
    glued = {item.contact for item in c.model.passes if item.bonds is not None}
    if glued and not safety_net:
        glued |= {item.contact for item in c.model.passes if item.pairs is not None}
    return [contact for k, contact in enumerate(c.contacts) if k not in glued]


def _off_axis(contact: ContactHistory, normal: Array, tangent: Array) -> float:
    """Angle by which a contact's normal is off its axes [degrees], each shape (3,); `normal` may be 0."""
    if contact.normal is None:
        return 0.0
    if normal.any():
        return math.degrees(math.acos(np.clip(contact.normal @ normal, -1.0, 1.0)))
    # normal forces add up as they are; tangential force must not hold some of them
    return math.degrees(math.asin(min(abs(contact.normal @ tangent), 1.0)))


def _listed(vector: NDArray[Any]) -> str:
    return ", ".join(f"{x:.3g}" for x in vector)
