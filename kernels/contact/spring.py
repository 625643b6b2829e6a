"""Owns the springs between slave nodes and what they touch: their state, forces and bookkeeping."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.dashpot import dashpot_function
from warp_mca.kernels.contact.friction import release, stick_slip
from warp_mca.kernels.contact.friction_laws import limit_function
from warp_mca.kernels.contact.laws import LINEAR, PLAIN, Laws, law_functions

FAR = 1e30  # larger than any distance [m]
ANY_DEPTH = FAR  # depth before the first step: bodies may overlap from the start


@wp.struct
class Spring:
    """State of every slave node's springs; arrays have shape (spring_count,), those of slave 0 first.

    tangential: friction force on the slave [N]. force: total force on it [N]. face: touched face or -1 [-].
    weight: shape functions of the touched point [-]. energy: elastic energy held [J]. friction: energy dissipated
    so far [J]. drive: work done by a moving plane so far [J]. impulse, normal_impulse, stick_impulse: force, normal
    force and normal force while sticking, summed over the steps since the last row of the history [N]. depth: largest
    penetration so far [m]. held: depth in the touched face, or in the last one for a node that slid off its side; 0
    in front of all faces, ANY_DEPTH before the first step unless clear of them [m]; planes leave it alone.
    stiffness: of the spring while it is pressed on a face [N/m]; planes leave it alone. lost: energy that it lost as it
    became softer [J]. rest: depth at which it is free of force [m], only where bodies that overlap start stress-free,
    and of masters with several sides. normal_energy: the part of `energy` that the normal spring holds [J], only of
    laws that are not linear. parameters: of the contact law [SI units], shape (spring_count, parameter_count). made:
    energy that it made so far as it closed or opened within a step, see `switch` [J]. left: compression with which the
    side pressed the node last, until it is in front of that side, below it without being pressed, or pressed by another
    [m]. support, share: the slave's edge that the spring presses in place of its node, or -1, and the node's share of
    the force [-]; see `edge_rest`. bears: 1 where the side was the last to press the node itself, else 0 [-]. These
    four are only of masters with several sides. dashpot: force of the law's dashpot in the last step [N], and energy
    that it dissipated so far [J]; only of laws that have one. limit: of the friction force in the last step [N], and
    friction_parameters: of the laws of friction [SI units], shape (law_count spring_count, parameter_count), those of
    spring 0 first; only of contacts with such laws.
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
    dashpot: wp.array(dtype=wp.vec2d)
    limit: wp.array(dtype=wp.float64)
    friction_parameters: wp.array2d(dtype=wp.float64)


@wp.func
def switch(
    s: int, before: wp.vec3d, stored: wp.float64, after: wp.vec3d, kept: wp.float64, du: wp.vec3d, spring: Spring
):
    """Book the energy that a spring makes in a step in which its normal force begins or ends.

    Central differences count the work (before + after) . du / 2 of the forces at both ends of the step, as if the
    spring were pressed all the way; so the spring makes `kept` - `stored` + this work. A linear spring that closes from
    a gap a to a depth b takes k a b / 2; one that opens by as much makes it.
    """
    spring.made[s] = spring.made[s] + (kept - stored + wp.float64(0.5) * wp.dot(before + after, du))


@wp.func
def normal_energy(s: int, pressed: wp.vec3d, k: wp.float64, spring: Spring):
    """Energy of the normal spring of stiffness k that was `pressed` [J]."""
    if spring.normal_energy.shape[0] == 0:
        return wp.float64(0.5) * wp.dot(pressed, pressed) / k
    return wp.where(spring.face[s] < 0, wp.float64(0.0), spring.normal_energy[s])


@cache
def pressure_function(friction: bool) -> Any:
    """The function that gives the normal force of a spring on its node [N]."""

    @wp.func
    def pressure(e: int, spring: Spring):
        force = spring.force[e]
        if wp.static(friction):
            force -= spring.tangential[e]
        return force

    return pressure


@cache
def rest_function(stress_free: bool) -> Any:
    """The function that measures a gap from the depth at which a spring is free: 0, or the overlap at the start.

    That overlap shrinks as the node moves outwards, and does not grow again.
    """

    @wp.func
    def gap_from_rest(s: int, gap: wp.float64, spring: Spring):
        if wp.static(stress_free):
            rest = wp.min(spring.rest[s], wp.max(-gap, wp.float64(0.0)))
            spring.rest[s] = rest
            gap += rest
        return gap

    return gap_from_rest


@cache
def spring_function(friction: bool, laws: Laws) -> Any:
    """The function that turns a gap into force, normal force and bookkeeping; without `friction` none is tangential.

    For a linear spring, energy and losses are computed from its force, not from the energy W of the law.
    """
    functions, linear, by_laws = law_functions(laws.normal), laws.normal == LINEAR, len(laws.friction) > 0
    law_force, law_energy = functions.force, functions.energy
    damped = functions.dashpot is not None
    damp = dashpot_function(laws.normal) if damped else None
    friction_limit = limit_function(laws.friction) if by_laws else None

    @wp.func
    def soften(
        s: int, gap: wp.float64, normal: wp.vec3d, du: wp.vec3d, k_old: wp.float64, k: wp.float64, spring: Spring
    ):
        """Book what a pressed spring loses as its stiffness falls; the share that is left."""
        # Along the normal, a step does the work of the mean of its two forces. With k_old to its end this balances the
        # energy W(g, k_old). With k it is less by (F(g, k_old) - F(g, k)) (g - g_old) / 2, and W(g, k) is left; of a
        # linear spring, (k_old - k) g_old g / 2 is lost. Along the surface the spring keeps its length f / k.
        share = k / k_old
        pressed = spring.force[s]
        lost = wp.float64(0.0)
        if wp.static(friction):
            pressed -= spring.tangential[s]
            lost = (wp.float64(1.0) - share) * release(spring.tangential[s], du, k_old)
        if wp.static(linear):
            lost -= wp.float64(0.5) * (wp.float64(1.0) - share) * wp.length(pressed) * gap
        else:
            fall = law_force(-gap, k_old, spring.parameters, s) - law_force(-gap, k, spring.parameters, s)
            lost += law_energy(-gap, k_old, spring.parameters, s) - law_energy(-gap, k, spring.parameters, s)
            lost += wp.float64(0.5) * fall * wp.dot(du, normal)
        spring.lost[s] = spring.lost[s] + lost
        return share

    @wp.func
    def push(
        s: int,
        gap: wp.float64,
        normal: wp.vec3d,
        du: wp.vec3d,
        k_old: wp.float64,
        k: wp.float64,
        closed: bool,
        dt: wp.float64,
        spring: Spring,
    ):
        """Normal force of spring and dashpot [N]; books what a spring makes that closes or opens in this step."""
        F = law_force(-gap, k, spring.parameters, s)
        Fn = F
        before = wp.vec3d()
        if wp.static(damped):
            pressed = spring.force[s]
            if wp.static(friction):
                pressed -= spring.tangential[s]
            Fn, before = damp(s, F, -gap, normal, du, k, pressed, dt, spring)
        if closed != (F > wp.float64(0.0)):
            if wp.static(not damped):
                before = spring.force[s]
                if wp.static(friction):
                    before -= spring.tangential[s]
            kept = law_energy(-gap, k, spring.parameters, s)
            switch(s, before, normal_energy(s, before, k_old, spring), F * normal, kept, du, spring)
        return Fn

    @wp.func
    def press(
        s: int,
        gap: wp.float64,
        normal: wp.vec3d,
        du: wp.vec3d,
        k_old: wp.float64,
        k: wp.float64,
        mu: wp.float64,
        dt: wp.float64,
        spring: Spring,
    ):
        """Force of a spring whose stiffness was k_old and is k [N/m], no more than that; the normal force."""
        # read everything before writing anything, so that a GPU waits for memory once
        impulse = spring.impulse[s]
        normal_impulse = spring.normal_impulse[s]
        depth = spring.depth[s]
        closed = spring.face[s] >= 0
        Fn = push(s, gap, normal, du, k_old, k, closed, dt, spring)
        force = Fn * normal
        squares = wp.float64(0.0)
        if wp.static(linear):
            squares = Fn * Fn
        if wp.static(not friction):
            if k < k_old:
                soften(s, gap, normal, du, k_old, k, spring)
        if wp.static(friction):
            friction_work = spring.friction[s]
            stick_impulse = spring.stick_impulse[s]
            f_old = spring.tangential[s]
            if k < k_old:
                f_old = soften(s, gap, normal, du, k_old, k, spring) * f_old
            limit = mu * Fn
            if wp.static(by_laws):
                limit = friction_limit(mu, Fn, normal, du, dt, spring.friction_parameters, s)
                spring.limit[s] = limit
            Ft, work, stick = stick_slip(f_old, du, normal, limit, k)
            force += Ft
            squares += wp.dot(Ft, Ft)
            spring.tangential[s] = Ft
            spring.friction[s] = friction_work + work
            if stick == 1 and mu > wp.float64(0.0):  # a scene of a batch may have no friction
                spring.stick_impulse[s] = stick_impulse + Fn
        if wp.static(linear):
            spring.energy[s] = wp.float64(0.5) * squares / k
        else:
            stored = law_energy(-gap, k, spring.parameters, s)
            spring.normal_energy[s] = stored
            spring.energy[s] = stored + wp.float64(0.5) * squares / k
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
    damp = dashpot_function(laws.normal) if damped else None

    @wp.func
    def open_contact(s: int, du: wp.vec3d, k: wp.float64, spring: Spring):
        pressed = spring.force[s]
        if wp.static(friction):
            pressed -= spring.tangential[s]
            spring.friction[s] = spring.friction[s] + release(spring.tangential[s], du, k)
            spring.tangential[s] = wp.vec3d()
        if wp.static(damped):
            zero = wp.float64(0.0)
            _, pressed = damp(s, zero, zero, wp.vec3d(), du, k, pressed, wp.float64(1.0), spring)
        switch(s, pressed, normal_energy(s, pressed, k, spring), wp.vec3d(), wp.float64(0.0), du, spring)
        spring.energy[s] = wp.float64(0.0)
        spring.force[s] = wp.vec3d()
        spring.face[s] = -1

    return open_contact
