"""Owns what probes and sections record: mean motion of some nodes, resultants of the forces of some elements."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.block import block_sum
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.nodes.floating import Frames, turn_function

LANES = 256  # threads of a block on a GPU; one on a CPU


@wp.kernel(enable_backward=False)
def mean_vectors(
    row: wp.array(dtype=wp.int32),
    offset: wp.array(dtype=wp.int32),
    node: wp.array(dtype=wp.int32),
    weight: wp.array(dtype=wp.float64),
    share: wp.float64,
    first: wp.array(dtype=wp.vec3d),
    second: wp.array(dtype=wp.vec3d),
    channel: wp.array(dtype=wp.int32),
    place: int,
    record_out: wp.array2d(dtype=wp.float64),
):
    """Means of share (first + second) over the nodes of each probe, into three of its channels from `place` on.

    `offset` says where the nodes of each probe begin in `node` and `weight`. A block of threads takes a probe.
    """
    p, lane = wp.tid()
    total = wp.vec3d()
    for k in range(offset[p] + lane, offset[p + 1], wp.block_dim()):
        i = node[k]
        total += weight[k] * share * (first[i] + second[i])
    mean = block_sum(total)
    if lane == 0:
        c = channel[p] + place
        for axis in range(3):
            record_out[row[0], c + axis] = mean[axis]


@cache
def resultants_kernel(precision: str, turned: bool) -> Any:
    """Kernel: resultant of the forces in some slots, and its moment about the mean place of their nodes.

    Entries `offset[s]` to `offset[s + 1]` of `slot`, `node` and `weight` are those of section s; weights of the slots
    of a node add up to its share in the mean. A block of threads takes a section.
    """
    vec3, to_world = scalars(precision).vec3, turn_function(turned)

    @wp.kernel(enable_backward=False, module="unique")
    def section_resultants(
        row: wp.array(dtype=wp.int32),
        offset: wp.array(dtype=wp.int32),
        slot: wp.array(dtype=wp.int32),
        node: wp.array(dtype=wp.int32),
        weight: wp.array(dtype=wp.float64),
        X: wp.array(dtype=wp.vec3d),
        u: wp.array(dtype=wp.vec3d),
        force: wp.array(dtype=vec3),
        frames: Frames,
        channel: wp.array(dtype=wp.int32),
        record_out: wp.array2d(dtype=wp.float64),
    ):
        s, lane = wp.tid()
        centre = wp.vec3d()
        for k in range(offset[s] + lane, offset[s + 1], wp.block_dim()):
            centre += weight[k] * (X[node[k]] + u[node[k]])
        centre = block_sum(centre)
        total = wp.vec3d()
        moment = wp.vec3d()
        for k in range(offset[s] + lane, offset[s + 1], wp.block_dim()):
            i = node[k]
            f = force[slot[k]]
            f_i = to_world(i, wp.vec3d(wp.float64(f[0]), wp.float64(f[1]), wp.float64(f[2])), frames)
            total += f_i
            moment += wp.cross(X[i] + u[i] - centre, f_i)
        total = block_sum(total)
        moment = block_sum(moment)
        if lane == 0:
            c = channel[s]
            for axis in range(3):
                record_out[row[0], c + axis] = total[axis]
                record_out[row[0], c + 3 + axis] = moment[axis]

    return section_resultants


@cache
def history_kernel(precision: str) -> Any:
    """Kernel: copy yield flags, if any, and history or extremes of some elements, whose forces are repeated."""
    R = scalars(precision).real

    @wp.kernel(enable_backward=False, module="unique")
    def copy_history(
        element: wp.array(dtype=wp.int32),
        yielded: wp.array(dtype=wp.int32),
        history: wp.array2d(dtype=R),
        yielded_out: wp.array(dtype=wp.int32),
        history_out: wp.array2d(dtype=R),
    ):
        k, j = wp.tid()
        e = element[j]
        history_out[k, j] = history[k, e]
        if k == 0 and yielded_out.shape[0] > 0:
            yielded_out[j] = yielded[e]

    return copy_history
