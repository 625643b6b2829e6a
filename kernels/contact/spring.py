"""Owns the springs between slave nodes and what they touch: their state, forces and bookkeeping."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.balance import energy_made
from warp_mca.kernels.contact.dashpot import dashpot_function
from warp_mca.kernels.contact.friction import release, stick_slip
from warp_mca.kernels.contact.friction_laws import limit_function
from warp_mca.kernels.contact.laws import PLAIN, Laws, law_functions
from warp_mca.kernels.contact.switching import ANY_DEPTH, GONE, parting_function, pay

FAR = ANY_DEPTH  # larger than any distance [m]


@wp.struct
class Spring:
    """State of every slave node's springs; arrays have shape (spring_count,), those of slave 0 first.

    tangential: friction force on the slave [N]. force: total force on it [N]. face: touched face or -1; -2 - f where
    the spring has left face f and still returns energy, see `kernels.contact.switching` [-]. weight: shape functions of
    the touched point [-]. energy: elastic energy held, and owed [J]. friction: energy dissipated so far [J].
    drive: work done by a moving plane, or by pressing bodies apart, so far [J]. impulse, normal_impulse, stick_impulse:
    force, normal force and normal force while sticking, summed over the steps since the last row of the history [N].
    depth: largest penetration so far [m]. held: depth in the touched face, or in the last one for a node that slid off
    its side; 0 in front of all faces, ANY_DEPTH before the first step unless clear of them [m]; planes leave it alone.
    stiffness: of the spring while it is pressed on a face [N/m]; planes leave it alone, but where elements fail. lost:
    energy that it lost as it became softer [J]. rest: depth at which it is free of force [m], only of surfaces, and of
    planes that bodies may overlap at the start, or whose slaves may fail. pressed: see `shrink` [m], and by how much it
    did so in the last step [m], only where bodies that overlap are pressed apart. normal_energy: the part of `energy`
    that the normal spring holds [J]. parameters: of the contact law [SI units], shape (spring_count, parameter_count).
    made: energy that it made so far, see `balance.energy_made` [J]. left: compression with which the side pressed the
    node last, until it is in front of that side, below it without being pressed, or pressed by another [m]. support,
    share: the slave's edge that the spring presses in place of its node, or -1, and the node's share of the force [-];
    see `edge_rest`. bears: 1 where the side was the last to press the node itself, else 0 [-]. rests: 1 where a spring
    of a slave node has a support, else 0 [-], shape (slave_count,). These five are only of masters with several sides.
    dashpot: force of the law's dashpot in the last step [N], and energy that it dissipated
    so far [J]; only of laws that have one. limit: of the friction force in the last step [N], and friction_parameters:
    of the laws of friction [SI units], shape (law_count spring_count, parameter_count), those of spring 0 first; only
    of contacts with such laws. bond: 1 while a bond holds the node to its place on `face`, -1 once it has failed, else
    0 [-]. bond_time: how long it has held [s]. bond_limit: forces in tension and in shear at which it fails [N]. These
    three are only of contacts with bonds. owed: energy that closing and opening took and that is not returned yet [J],
    force that returns it [N], and the greatest share of the spring's force that it may be, 0 for none [-]; only of
    contacts that return energy.
    """

    tangential: wp.array(dtype=wp.vec3d)
    force: wp.array(dtype=wp.vec3d)
    face: wp.array(dtype=wp.int32)
    weight: wp.array(dtype=wp.vec4d)
    energy: wp.array(dtype=wp.float64)
    friction: wp.array(dtype=wp.float64)
    drive: wp.array(dtype=wp.float64)
    impulse: wp.array(dtype=wp.vec3d)
    normal_impulse: wp.array(dtype=wp.float64)
    stick_impulse: wp.array(dtype=wp.float64)
    depth: wp.array(dtype=wp.float64)
    held: wp.array(dtype=wp.float64)
    stiffness: wp.array(dtype=wp.float64)
    lost: wp.array(dtype=wp.float64)
    rest: wp.array(dtype=wp.float64)
    normal_energy: wp.array(dtype=wp.float64)
    parameters: wp.array2d(dtype=wp.float64)
    made: wp.array(dtype=wp.float64)
    left: wp.array(dtype=wp.float64)
    support: wp.array(dtype=wp.int32)
    share: wp.array(dtype=wp.float64)
    bears: wp.array(dtype=wp.int32)
    rests: wp.array(dtype=wp.int32)
    dashpot: wp.array(dtype=wp.vec2d)
    limit: wp.array(dtype=wp.float64)
    friction_parameters: wp.array2d(dtype=wp.float64)
    pressed: wp.array(dtype=wp.vec2d)
    owed: wp.array(dtype=wp.vec3d)
    bond: wp.array(dtype=wp.int32)
    bond_time: wp.array(dtype=wp.float64)
    bond_limit: wp.array(dtype=wp.vec2d)


@cache
def pressure_function(friction: bool) -> Any:
    """The function that gives the normal force of a spring on its node [N]."""

    @wp.func
    def pressure(e: int, spring: Spring):
        force = spring.force[e]
        if wp.static(friction):
            force -= spring.tangential[e]
        return wp.where(spring.face[e] < GONE, wp.vec3d(), force)

    return pressure


@wp.func
def shrink(s: int, rest: wp.float64, spring: Spring) -> wp.float64:
    """By how much the overlap `rest` of bodies that are pressed apart shrinks in this step [m].

    In steps of a, 2 a, ..., h a, h a, ..., 2 a, a, so smoothly that few springs open; j (j + 1) / 2 a are left for the
    last j.
    """
    a = spring.pressed[s][0]
    one = wp.float64(1.0)
    left = wp.float64(0.5) * (wp.sqrt(one + wp.float64(8.0) * rest / a) - one)
    given = wp.min(wp.min(spring.pressed[s][1] + a, a * wp.max(left, one)), rest)
    spring.pressed[s] = wp.vec2d(wp.where(given < rest, a, wp.float64(0.0)), given)
    return given


@cache
def rest_function(pressed: bool) -> Any:
    """The function (s, gap, rest, spring) -> (gap from the depth `rest` at which a spring is free, new rest) [m].

    That overlap shrinks as the node moves outwards, and does not grow again. Where bodies are pressed apart it shrinks
    by itself, too. `Spring.rest` is left to the caller, who writes it once all is read.
    """

    @wp.func
    def gap_from_rest(s: int, gap: wp.float64, rest: wp.float64, spring: Spring):
        left = wp.min(rest, wp.max(-gap, wp.float64(0.0)))
        if wp.static(pressed):
            if spring.pressed[s][0] > wp.float64(0.0):
                left = rest - shrink(s, rest, spring)
                gap = wp.min(gap, -left)  # a node that moves out faster has no force, and the overlap shrinks on
            else:
                spring.pressed[s] = wp.vec2d()
        return gap + left, left

    return gap_from_rest


@cache
def spring_function(friction: bool, laws: Laws) -> Any:
    """The function that turns a gap into force, normal force and bookkeeping; without `friction` none is tangential.

    Energy and losses follow from the energy W of the law.
    """
    functions, by_laws = law_functions(laws.normal), len(laws.friction) > 0
    law_force, law_energy = functions.force, functions.energy
    damped = functions.dashpot is not None
    damp = dashpot_function(laws.normal) if damped else None
    friction_limit = limit_function(laws.friction) if by_laws else None

    @wp.func
    def soften(
        s: int, gap: wp.float64, normal: wp.vec3d, du: wp.vec3d, k_old: wp.float64, k: wp.float64, spring: Spring
    ):
        """Book what a pressed spring loses as its stiffness falls; the share that is left, and that energy."""
        # Along the normal, a step does the work of the mean of its two forces. With k_old to its end this balances the
        # energy W(g, k_old). With k it is less by (F(g, k_old) - F(g, k)) (g - g_old) / 2, and W(g, k) is left.
        # Along the surface the spring keeps its length f / k.
        share = k / k_old
        lost = wp.float64(0.0)
        if wp.static(friction):
            lost = (wp.float64(1.0) - share) * release(spring.tangential[s], du, k_old)
        fall = law_force(-gap, k_old, spring.parameters, s) - law_force(-gap, k, spring.parameters, s)
        lost += law_energy(-gap, k_old, spring.parameters, s) - law_energy(-gap, k, spring.parameters, s)
        lost += wp.float64(0.5) * fall * wp.dot(du, normal)
        spring.lost[s] = spring.lost[s] + lost
        return share, lost

    @wp.func
    def friction_before(s: int, spring: Spring):
        if wp.static(friction):
            return spring.tangential[s], spring.friction[s], spring.stick_impulse[s]
        return wp.vec3d(), wp.float64(0.0), wp.float64(0.0)

    @wp.func
    def press(
        s: int,
        gap: wp.float64,
        normal: wp.vec3d,
        slip: wp.vec3d,
        du: wp.vec3d,
        k_old: wp.float64,
        k: wp.float64,
        mu: wp.float64,
        dt: wp.float64,
        spring: Spring,
    ):
        """Force of a spring whose stiffness fell from k_old to k [N/m]; normal force. Friction acts across `slip`."""
        # read everything before writing anything, so that a GPU waits for memory once
        impulse, normal_impulse, depth = spring.impulse[s], spring.normal_impulse[s], spring.depth[s]
        made_before, force_old, energy_old = spring.made[s], spring.force[s], spring.energy[s]
        tangential, friction_work, stick_impulse = friction_before(s, spring)
        half, share, owed = wp.float64(0.5), wp.float64(1.0), wp.float64(0.0)
        spent, dashpots, aside = wp.float64(0.0), wp.float64(0.0), wp.vec3d()
        Fn, stored = law_force(-gap, k, spring.parameters, s), law_energy(-gap, k, spring.parameters, s)
        if wp.static(laws.returns):
            F, W = law_force(-gap, k_old, spring.parameters, s), law_energy(-gap, k_old, spring.parameters, s)
            c, aside, owed, spent = pay(s, F, W, k_old, force_old, tangential, du, normal, slip, spring)
            Fn += c
        if wp.static(damped):
            dashpots = spring.dashpot[s][0]
            Fn, dissipated = damp(s, Fn, -gap, normal, du, k, force_old - tangential, dt, spring)
            dashpots += spring.dashpot[s][0]
            spent += dissipated
        if k < k_old:
            share, lost = soften(s, gap, normal, du, k_old, k, spring)
            spent += lost
        force, energy = Fn * normal + aside, stored + owed  # `aside` lies across the normal
        if wp.static(friction):
            limit = mu * Fn
            if wp.static(by_laws):
                limit = friction_limit(mu, Fn, slip, du, dt, spring.friction_parameters, s)
                spring.limit[s] = limit
            Ft, work, stick = stick_slip(share * tangential, du, slip, limit, k)
            force += Ft
            energy += half * wp.dot(Ft, Ft) / k
            spent += work
            spring.friction[s] = friction_work + work
            if stick == 1 and mu > wp.float64(0.0):  # a scene of a batch may have no friction
                spring.stick_impulse[s] = stick_impulse + Fn
        made = energy_made(force_old, energy_old, force, energy, spent, du)
        if wp.static(laws.pressed):  # work on the spring that brings the overlap in, of both ends of the step
            given = half * (wp.length(force_old - tangential) + Fn - dashpots) * spring.pressed[s][1]
            made -= given
            spring.drive[s] = spring.drive[s] + given
        if wp.static(friction):
            spring.tangential[s] = Ft
        spring.made[s] = made_before + made
        spring.energy[s] = energy
        spring.normal_energy[s] = stored
        spring.force[s] = force
        spring.impulse[s] = impulse + force
        spring.normal_impulse[s] = normal_impulse + Fn
        spring.depth[s] = wp.max(depth, -gap)
        return force, Fn

    return press


@cache
def open_function(friction: bool, laws: Laws = PLAIN) -> Any:
    """The function that clears the springs of a node that lost its contact."""
    damped = law_functions(laws.normal).dashpot is not None
    damp, pressure = dashpot_function(laws.normal) if damped else None, pressure_function(friction)

    @wp.func
    def open_contact(s: int, du: wp.vec3d, k: wp.float64, spring: Spring):
        zero = wp.float64(0.0)
        spent = zero
        if wp.static(damped):
            _, spent = damp(s, zero, zero, wp.vec3d(), du, k, pressure(s, spring), wp.float64(1.0), spring)
        if wp.static(friction):
            released = release(spring.tangential[s], du, k)
            spring.friction[s] = spring.friction[s] + released
            spent += released
            spring.tangential[s] = wp.vec3d()
        made = energy_made(spring.force[s], spring.energy[s], wp.vec3d(), zero, spent, du)
        spring.made[s] = spring.made[s] + made
        spring.energy[s] = zero
        spring.force[s] = wp.vec3d()
        spring.face[s] = -1

    return open_contact


@cache
def release_function(friction: bool, laws: Laws) -> Any:
    """The function that opens a spring, at once or in steps that return what it owes; its force on the node [N]."""
    open_contact = open_function(friction, laws)
    part = parting_function(friction, open_contact)

    @wp.func
    def let_open(s: int, du: wp.vec3d, normal: wp.vec3d, k: wp.float64, may_stay: bool, spring: Spring):
        force = wp.vec3d()
        if wp.static(laws.returns):
            force = part(s, du, normal, k, may_stay, spring)
        else:
            open_contact(s, du, k, spring)
        return force

    return let_open
