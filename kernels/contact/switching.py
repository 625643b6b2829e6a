"""Owns the energy that a contact spring owes after it closed or opened within a step, and the forces that return it.

Central differences count work by the forces at both ends of a step. A linear spring that closes from a gap a to a depth
b takes k a b / 2 too much, and one that opens by as much gives k a b / 2 too much. The spring keeps that difference as
a debt, and adds to its force what returns it over the next steps, as the velocity updates of Laursen and Love (Int. J.
Numer. Methods Engrg. 53 (2002) 245) do. A spring that opened stays for these steps: its `Spring.face` is -2 - f then,
with the face f that it left.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.balance import energy_made
from warp_mca.kernels.contact.friction import release

SHARE = 0.05  # greatest force that returns energy, over the force of a pressed spring
PULL = 0.1  # the same over k times the motion of a step
IDLE = 1e-3  # debt that rests, over the energy of a pressed spring
LEAST = 1e-6  # debt that counts as returned once a spring is open, over k times the square of that motion
TURNS = 0.02  # sine of the angle between a normal and the last force from which on it has turned

ANY_DEPTH = 1e30  # `Spring.held` before the first step, when bodies may overlap [m]
GONE = -1  # `Spring.face` of a spring that neither presses nor returns energy


@wp.func
def face_left(face: int) -> int:
    """The face that a spring presses, or that it left and still returns energy to; -1 without."""
    return wp.where(face < GONE, -2 - face, face)


@wp.func
def returns_energy(s: int, spring: Any) -> bool:
    """Whether spring s does; in a batch those of some scenes may not."""
    return spring.owed[s][2] > wp.float64(0.0)


@wp.func
def forget(s: int, spring: Any):
    """Let spring s owe nothing any more, where springs return energy."""
    if spring.owed.shape[0] > 0:
        spring.owed[s] = wp.vec3d(wp.float64(0.0), wp.float64(0.0), spring.owed[s][2])


@wp.func
def returning(owed: wp.float64, out: wp.float64, most: wp.float64) -> wp.float64:
    """Force [N], no more than `most`, that returns the energy `owed` [J] where a step moves the node by `out` [m]."""
    size = wp.min(most, wp.abs(owed / out))
    return wp.where((owed > wp.float64(0.0)) == (out > wp.float64(0.0)), size, -size)


@wp.func
def pay(
    s: int,
    F: wp.float64,
    W: wp.float64,
    k: wp.float64,
    before: wp.vec3d,
    along: wp.vec3d,
    du: wp.vec3d,
    normal: wp.vec3d,
    slip: wp.vec3d,
    spring: Any,
) -> tuple[wp.float64, wp.vec3d, wp.float64, wp.float64]:
    """What spring s, which holds W and presses with F, adds to its force [N]; sets what it owes then.

    A force whose direction jumps, as in a dent, drives a node to and fro across the jump. Energy that it made so is
    taken back where it went: along the way in which the normal turned, also for steps after that, since the force aside
    keeps the last direction apart from the normal.

    Args:
        k: its stiffness [N/m].
        before, along: its force on the node in the last step, and the part of friction [N].
        du: motion of the node relative to the face since then [m].
        normal, slip: unit normals of the face, and of the plane in which friction acts.

    Returns:
        This force along the normal, and across it; what the spring owes then [J]; how much less contact has lost,
        because the spring begins with energy that another one lost, below 0 [J].
    """
    half, zero = wp.float64(0.5), wp.float64(0.0)
    owed = spring.owed[s]
    c = zero
    aside = wp.vec3d()
    left = zero
    lost = zero
    if owed[2] > zero and F > zero:
        out = wp.dot(du, normal)
        now = -half * F * out - W
        if spring.face[s] < 0 and now < zero:
            if spring.held[s] < wp.float64(ANY_DEPTH):  # in the first step bodies may overlap
                lost = now
            now = zero
        left = spring.normal_energy[s] + owed[0] - half * wp.dot(before - along, du) + now
        turned = wp.dot(along, slip)  # the part that friction loses where its plane has turned
        left += half * turned * (turned / k - wp.dot(du, slip))
        if wp.abs(left) > wp.float64(wp.static(IDLE)) * W and out != zero:
            pressure = before - along
            turn = wp.dot(pressure, normal) * normal - pressure
            size = wp.length(turn)
            if left < zero and size > wp.float64(wp.static(TURNS)) * wp.length(pressure):
                turn = turn / size
                out = wp.dot(du, turn)
                aside = returning(left, out, owed[2] * F) * turn
                left -= half * wp.dot(aside, du)
            else:
                c = returning(left, out, owed[2] * F)
                left -= half * c * out
    spring.owed[s] = wp.vec3d(left, c, owed[2])
    spring.lost[s] = spring.lost[s] + lost
    return c, aside, left, lost


@cache
def parting_function(friction: bool, open_contact: Any) -> Any:
    """The function that opens a spring in steps; its force on the slave node [N].

    `open_contact`: opens it at once, as where `may_stay` does not hold or nothing is owed any more.
    """

    @wp.func
    def part(s: int, du: wp.vec3d, normal: wp.vec3d, k: wp.float64, may_stay: bool, spring: Any) -> wp.vec3d:
        half, zero = wp.float64(0.5), wp.float64(0.0)
        owed, face, out = spring.owed[s], spring.face[s], wp.dot(du, normal)
        before = spring.force[s]
        if wp.static(friction):
            before -= spring.tangential[s]
        left = spring.normal_energy[s] + owed[0] - half * wp.dot(before, du)
        stays = may_stay and owed[2] > zero
        size = k * out * out
        if face >= 0:
            switched = left - owed[0] + half * owed[1] * out
            stays = stays and switched <= zero  # else it still was pressed as it was released
            if stays:
                kept = wp.clamp(left, -size, size)
                spring.lost[s] = spring.lost[s] + wp.max(left - kept, zero)
                spring.made[s] = spring.made[s] + wp.max(left - kept, zero)
                left = kept
        stays = stays and wp.abs(left) > wp.float64(wp.static(LEAST)) * size
        force = wp.vec3d()
        if stays:
            c = zero
            if out > zero:
                c = returning(left, out, wp.float64(wp.static(PULL)) * k * out)
            left -= half * c * out
            force = c * normal
            spent = zero
            if wp.static(friction):
                if face >= 0:
                    spent = release(spring.tangential[s], du, k)
                    spring.friction[s] = spring.friction[s] + spent
                    spring.tangential[s] = wp.vec3d()
            made = energy_made(spring.force[s], spring.energy[s], force, left, spent, du)
            spring.made[s] = spring.made[s] + made
            spring.energy[s] = left
            spring.normal_energy[s] = zero
            spring.force[s] = force
            spring.impulse[s] = spring.impulse[s] + force
            spring.normal_impulse[s] = spring.normal_impulse[s] + c
            spring.owed[s] = wp.vec3d(left, c, owed[2])
            spring.face[s] = -2 - face_left(face)
        else:
            open_contact(s, du, k, spring)
            if owed[2] > zero:
                lost = wp.max(left, zero)  # what it holds as it is let go
                spring.lost[s] = spring.lost[s] + lost
                spring.made[s] = spring.made[s] + lost
                spring.normal_energy[s] = zero
                spring.owed[s] = wp.vec3d(zero, zero, owed[2])
        return force

    return part
