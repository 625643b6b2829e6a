"""Owns the energy that contact springs make as central differences count work."""

import warp as wp


@wp.func
def energy_made(
    force_old: wp.vec3d, stored_old: wp.float64, force: wp.vec3d, stored: wp.float64, spent: wp.float64, du: wp.vec3d
):
    """Energy [J] that a spring makes in a step after which it gives `force`, holds `stored`, and in which it `spent`.

    Central differences count the work (f_old + f) . du / 2 of the forces at both ends of the step. A linear spring that
    closes from a gap a to a depth b takes k a b / 2 so; one that opens by as much makes it. Normals that change make
    some, too. Over all springs this is what contact adds to the imbalance of a run.
    """
    return stored - stored_old + spent + wp.float64(0.5) * wp.dot(force_old + force, du)


@wp.func
def compression_kept(stored: wp.float64, force: wp.vec3d, du: wp.vec3d, normal: wp.vec3d, k: wp.float64) -> wp.float64:
    """Compression c [m] of a linear spring of stiffness k that takes over from another without making energy.

    The other one holds `stored` [J] and gave `force` [N] before the motion du [m]; the new one acts along `normal`:
    k c^2 / 2 + (force + k c normal) . du / 2 = stored.
    """
    half = wp.float64(0.5)
    approach = -wp.dot(du, normal)
    held = wp.max(stored - half * wp.dot(force, du), wp.float64(0.0))
    return half * (approach + wp.sqrt(approach * approach + wp.float64(8.0) * held / k))
