"""Owns the sums of energy and work at absorbing boundaries, for each scene separately."""

import warp as wp

from warp_mca.kernels.hardware.block import block_sum
from warp_mca.kernels.records.columns import ABSORBED, BEYOND_WORK
from warp_mca.kernels.records.ledger import run_of


@wp.kernel(enable_backward=False)
def sum_absorbed(
    row: wp.array(dtype=wp.int32),
    column: int,
    first: wp.array(dtype=wp.int32),
    velocity: wp.array(dtype=wp.vec3d),
    impulse: wp.array(dtype=wp.vec3d),
    absorbed: wp.array(dtype=wp.float64),
    partial_out: wp.array4d(dtype=wp.float64),
):
    """Write absorbed energy, and work of the surroundings, which move with `velocity`, from `column` on.

    `first` has the first node of absorbing boundaries of each scene. Sums are formed as in `records.ledger`.
    """
    scene, k, lane = wp.tid()
    energy = wp.float64(0.0)
    work = wp.float64(0.0)
    begin, end = run_of(first[scene], first[scene + 1], k)
    for i in range(begin + lane, end, wp.block_dim()):
        energy += absorbed[i]
        work -= wp.dot(velocity[i], impulse[i])
    energy = block_sum(energy)
    work = block_sum(work)
    if lane == 0:
        partial_out[row[0], scene, column + wp.static(ABSORBED), k] = energy
        partial_out[row[0], scene, column + wp.static(BEYOND_WORK), k] = work
