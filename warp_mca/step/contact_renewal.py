"""Owns the passage of contact springs from one surface to the next, where elements have failed in between.

A spring that presses a face which is still there goes on as it was. Those of faces that have gone let go: the energy W
that they hold counts as lost by contact. Central differences have half of the work of their force f, f . du / 2, in the
step in which they let go, so W - f . du / 2 is lost. What springs that end have booked so far is added to the first of
a pass.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.base.arrays import Index
from warp_mca.physics.contact.actor import stage_of
from warp_mca.physics.contact.skin_edges import EdgePass

if TYPE_CHECKING:
    from warp_mca.step.solver import Solver
    from warp_mca.system.contact import ContactPass
    from warp_mca.system.state import State

Springs = dict[str, NDArray]

# Arrays of springs that go with them from row to row, and those that add up.
GOES = (
    *(
        "tangential",
        "force",
        "weight",
        "energy",
        "held",
        "stiffness",
        "rest",
        "normal_energy",
        "left",
        "bears",
        "limit",
        "owed",
    ),
    *("dashpot", "pressed"),
)
BOOKED = ("friction", "drive", "impulse", "normal_impulse", "stick_impulse", "lost", "made")


def renew(solver: Solver, state: State, passes: Sequence[ContactPass]) -> None:
    """Let the contacts of the only scene have other surfaces from now on; `passes` are as many as before."""
    contacts, work = solver.contacts, solver.work
    with wp.ScopedDevice(solver.device):
        before = [
            (stage.items[0], stage.sides, _read(own)) for stage, own in zip(contacts, state.contacts, strict=True)
        ]
        v, dt = np.array(state.v.numpy(), dtype=np.float64), solver.nodes.dt
        for item, sides, springs in before:
            moved = dt * (springs["force"] * _relative(item, sides, springs, v)).sum(axis=1)
            springs["let_go"] = springs["energy"] - 0.5 * moved
        for k, item in enumerate(passes):
            contacts[k] = stage_of([item], solver.model, k, contacts.normal_force)
            state.contacts[k] = contacts[k].new_state()
        solver.renew(state)
        solver.begin(state)
        rows = []
        for k, (item, sides, springs) in enumerate(before):
            row, face = _rows(item, passes[k], springs["face"], sides, contacts[k].sides)
            rows.append(row)
            _carry(springs, state.contacts[k].spring, row, face)
        _free_new(solver, state, rows)
        work.nodal_force.zero_()
        for k, (item, _, springs) in enumerate(before):
            own = k if int(contacts[k].springs[-1]) else [other.contact for other in passes].index(item.contact)
            _book(springs, state.contacts[k].spring, rows[k], state.contacts[own].spring)


def _read(own: Any) -> Springs:
    return {name: getattr(own.spring, name).numpy() for name in (*GOES, *BOOKED, "face", "depth")}


def _relative(item: ContactPass, sides: int, springs: Springs, v: NDArray[np.float64]) -> NDArray[np.float64]:
    """Velocity of what each spring presses relative to its master [m/s], shape (spring_count, 3); 0 of open ones.

    A spring that presses an edge of the slave in place of its node counts as one of the node.
    """
    number, face, weight = np.arange(len(springs["face"])) // sides, springs["face"], springs["weight"]
    if item.plane is not None:
        return v[item.slave[number]] - np.asarray(item.plane.velocity)
    if not len(face):
        return np.zeros((0, 3))
    if isinstance(item, EdgePass):
        own = (weight[:, :2, None] * v[item.slave_edge[number]]).sum(axis=1)
        found = own - (weight[:, 2:, None] * v[item.master_edge[face]]).sum(axis=1)
    else:
        found = v[item.slave[number]] - (weight[:, :, None] * v[item.face[face]]).sum(axis=1)
    return np.where(face[:, None] >= 0, found, 0.0)


def _match(old: Index, new: Index) -> NDArray[np.intp]:
    """Place of each row of `old` in `new`, -1 where it is none of these."""
    _, row = np.unique(np.concatenate([new, old]), axis=0, return_inverse=True)
    place = np.full(len(new) + len(old), -1)
    row = row.ravel()
    place[row[: len(new)]] = np.arange(len(new))
    return place[row[len(new) :]]


def _rows(
    old: ContactPass, new: ContactPass, face: Index, sides: int, sides_now: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Where each spring goes on, -1 where it ends, and the number that the face it presses has now, -1 without.

    Springs that press nothing end on surfaces, whose search finds anew which nodes are clear.
    """
    if isinstance(old, EdgePass):
        assert isinstance(new, EdgePass)
        slave, master = _match(old.slave_edge, new.slave_edge), _match(old.master_edge, new.master_edge)
    else:
        slave, master = _match(old.slave[:, None], new.slave[:, None]), _match(old.face, new.face)
    number, place = np.divmod(np.arange(len(face)), sides)
    own, at = slave[number], np.full(len(face), -1)
    if old.plane is not None:
        return own, face.astype(np.intp)
    pressed = face >= 0
    at[pressed] = master[face[pressed]]
    side = place
    if not isinstance(old, EdgePass) and len(new.face):
        side = new.side[np.maximum(at, 0)] if sides_now > 1 else np.zeros(len(face), int)
    row = np.where((own >= 0) & (at >= 0), sides_now * own + side, -1)
    first = np.zeros(len(row), dtype=bool)
    first[np.unique(row, return_index=True)[1]] = True
    row[~first] = -1  # of two springs that would become one, one ends
    return row, at


def _carry(springs: Springs, spring: Any, row: NDArray[np.intp], face: NDArray[np.intp]) -> None:
    """Let springs go on at other rows."""
    kept = row >= 0
    for name, given in {**{name: springs[name] for name in GOES}, "face": face.astype(np.int32)}.items():
        array = getattr(spring, name)
        if len(array):
            found = array.numpy()
            if len(given):
                found[row[kept]] = given[kept]
            elif name == "bears":  # of a master that had one side
                found[row[kept & (face >= 0)]] = 1
            array.assign(found)


def _free_new(solver: Solver, state: State, rows: Sequence[NDArray[np.intp]]) -> None:
    """New springs of nodes that lie behind the new faces are free of force there."""
    tried = state.copy()
    for k, stage in enumerate(solver.contacts):
        stage.launch(solver.work, tried, 0.0)
        depth, rest = tried.contacts[k].spring.depth.numpy(), state.contacts[k].spring.rest
        depth[rows[k][rows[k] >= 0]] = 0.0
        if depth.any() and len(rest) == len(depth):
            rest.assign(np.where(depth > 0.0, depth, rest.numpy()))


def _book(springs: Springs, spring: Any, row: NDArray[np.intp], first: Any) -> None:
    """What springs have booked; that of springs that ended is added to the first one of `first`."""
    kept = row >= 0
    ended = ~kept
    for name in (*BOOKED, "depth"):
        given, array = springs[name], getattr(spring, name)
        if len(array):
            found = array.numpy()
            found[row[kept]] = given[kept]
            array.assign(found)
    if not ended.any():
        return
    sums = {name: springs[name][ended].sum(axis=0) for name in BOOKED}
    sums["lost"] = sums["lost"] + springs["let_go"][ended].sum()
    for name, value in sums.items():
        array = getattr(first, name)
        found = array.numpy()
        found[0] += value
        array.assign(found)
    found = first.depth.numpy()
    found[0] = max(found[0], springs["depth"][ended].max())
    first.depth.assign(found)
    if len(springs["dashpot"]):
        found = first.dashpot.numpy()
        found[0, 1] += springs["dashpot"][ended, 1].sum()
        first.dashpot.assign(found)
