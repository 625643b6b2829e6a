"""Owns the sums of work and heat at a chain's joints and base, for each scene separately."""

import warp as wp

from warp_mca.kernels.records.columns import CARRIAGE, JOINT_HEAT, LOAD_WORK


@wp.kernel(enable_backward=False)
def sum_loads(
    row: wp.array(dtype=wp.int32),
    first_hinge: wp.array(dtype=wp.int32),
    hinge_work: wp.array(dtype=wp.vec2d),
    first_base: wp.array(dtype=wp.int32),
    base_work: wp.array(dtype=wp.float64),
    kinetic: wp.array(dtype=wp.float64),
    partial_out: wp.array4d(dtype=wp.float64),
):
    """Work of drives and bases, heat of friction and kinetic energy of carriages [J]; a thread for each scene.

    `first_hinge` and `first_base` are the first loaded hinge and the first base of each scene.
    """
    scene = wp.tid()
    work = wp.float64(0.0)
    heat = wp.float64(0.0)
    carriages = wp.float64(0.0)
    for j in range(first_hinge[scene], first_hinge[scene + 1]):
        work += hinge_work[j][0]
        heat -= hinge_work[j][1]
    for k in range(first_base[scene], first_base[scene + 1]):
        work += base_work[k]
        carriages += kinetic[k]
    partial_out[row[0], scene, wp.static(LOAD_WORK), 0] = work
    partial_out[row[0], scene, wp.static(JOINT_HEAT), 0] = heat
    partial_out[row[0], scene, wp.static(CARRIAGE), 0] = carriages
