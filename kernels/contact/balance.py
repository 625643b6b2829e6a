"""Owns the energy that contact springs make as central differences count work, and how they take it back."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.laws import law_functions

_MOST = 0.5  # greatest change of a normal force, as a share of it
_SLOW = 0.25  # motion in a step over the depth, below which the change fades as the node turns round
_REACHED = 1.0 + 1e-6  # a spring that begins deeper than so many times the motion was inside before


@wp.func
def energy_made(s: int, force: wp.vec3d, stored: wp.float64, spent: wp.float64, du: wp.vec3d, spring: Any):
    """Energy [J] that spring s makes in a step after which it gives `force`, holds `stored`, and in which it `spent`.

    Central differences count the work (f_old + f) . du / 2 of the forces at both ends of the step. A linear spring that
    closes from a gap a to a depth b takes k a b / 2 so; one that opens by as much makes it. Normals that change make
    some, too. Over all springs this is what contact adds to the imbalance of a run.
    """
    work = wp.float64(0.5) * wp.dot(spring.force[s] + force, du)
    return stored - spring.energy[s] + spent + work


@cache
def take_back_function(law: str) -> Any:
    """The function by which the normal force takes back the energy that its spring made.

    A change dF of the force does the work dF d, half in this step and half in the next if both move the node by d into
    the face. To take back the energy A asks for dF = A / d; here it is A d / (d^2 + (g / 4)^2) with the depth g, since
    d may change its sign in the next step, and F / 2 at most. A is what is owed from steps before, what this step
    makes with the force F of the law, and what the next one makes if it opens the spring. A linear spring that
    closes from a gap a to a depth b << d so begins with k b (a + 2 b) / (2 a + 2 b), the mean of much finer steps.
    """
    functions = law_functions(law)
    law_energy = functions.energy

    @wp.func
    def take_back(
        s: int,
        depth: wp.float64,
        closing: wp.float64,
        F: wp.float64,
        made: wp.float64,
        k: wp.float64,
        spring: Any,
    ) -> tuple[wp.float64, wp.float64]:
        """The change of F [N], and what is owed from steps before [J].

        Args:
            closing: motion of the node into the face in this step [m].
            made: energy that the spring makes in this step with the force F [J].
        """
        owed = spring.owed[s]
        change = wp.float64(0.0)
        begins = spring.face[s] < 0
        if begins:  # a node that rattles owes no more than this touch may make
            most = law_energy(wp.max(closing, wp.float64(0.0)), k, spring.parameters, s)
            owed = wp.clamp(owed, -most, most)
        due = owed + made
        if depth + closing < wp.float64(0.0):
            due -= law_energy(depth, k, spring.parameters, s) + wp.float64(0.5) * F * closing
        square = closing * closing + wp.float64(wp.static(_SLOW**2)) * depth * depth
        if square > wp.float64(0.0):
            most = wp.float64(_MOST) * F
            change = wp.clamp(due * closing / square, -most, most)
        if begins and depth > wp.float64(_REACHED) * wp.max(closing, wp.float64(0.0)):  # as bodies that overlap do
            change = wp.float64(0.0)
            owed = -made
        return change, owed

    return take_back
