"""Owns the energy that contact springs make as central differences count work."""

from typing import Any

import warp as wp


@wp.func
def energy_made(s: int, force: wp.vec3d, stored: wp.float64, spent: wp.float64, du: wp.vec3d, spring: Any):
    """Energy [J] that spring s makes in a step after which it gives `force`, holds `stored`, and in which it `spent`.

    Central differences count the work (f_old + f) . du / 2 of the forces at both ends of the step. A linear spring that
    closes from a gap a to a depth b takes k a b / 2 so; one that opens by as much makes it. Normals that change make
    some, too. Over all springs this is what contact adds to the imbalance of a run.
    """
    work = wp.float64(0.5) * wp.dot(spring.force[s] + force, du)
    return stored - spring.energy[s] + spent + work
