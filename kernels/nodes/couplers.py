"""Owns couplers: rows that tie a rate of a joint between whole bodies to that of another one.

The row of q_1 = ratio q_2 + offset gives the impulse s to the row of the one rate and -ratio s to that of the other,
see `rigid_joints`. Of positions that both keep at every t(n) the impulses do no work.
"""

import warp as wp

from warp_mca.kernels.nodes.joint_arrays import JointPoses
from warp_mca.kernels.nodes.rigid_motion import Poses, RigidBodies, RigidStep
from warp_mca.kernels.nodes.rigid_rows import RigidRows, give_impulse, row_lightness


@wp.func
def share_of(r: int, k: int, rows: RigidRows) -> wp.float64:
    """What the first (k = 0) or second part of a row takes of its impulse; all of a row that is no coupler."""
    if k == 0:
        return wp.float64(1.0)
    return -rows.ratio[r]


@wp.func
def is_coupler(r: int, rows: RigidRows) -> bool:
    """Whether row r ties two rates."""
    return rows.part[r][0] >= 0


@wp.func
def coupler_lightness(r: int, s: int, bodies: RigidBodies, rows: RigidRows, moves: bool, step: RigidStep) -> wp.float64:
    """As `rigid_rows.row_lightness`, where one of the rows is a coupler."""
    found = wp.float64(0.0)
    for i in range(2):
        for k in range(2):
            a = r
            b = s
            if is_coupler(r, rows):
                a = rows.part[r][i]
            if is_coupler(s, rows):
                b = rows.part[s][k]
            if (i == 0 or is_coupler(r, rows)) and (k == 0 or is_coupler(s, rows)):
                share = share_of(r, i, rows) * share_of(s, k, rows)
                found += share * row_lightness(a, b, bodies, rows, moves, step)
    return found


@wp.func
def open_couplers(
    begin: int,
    end: int,
    span: wp.float64,
    worst: wp.float64,
    rows: RigidRows,
    state: JointPoses,
    step_out: RigidStep,
) -> wp.float64:
    """Negative speeds at which couplers would be off by t(n+1) [rad/s], [m/s], and the greatest of all rows."""
    found = worst
    for r in range(begin, end):
        if is_coupler(r, rows):
            e = rows.rate[rows.part[r][0]]
            f = rows.rate[rows.part[r][1]]
            off = state.position[e] - rows.ratio[r] * state.position[f] - rows.offset[r]
            off += step_out.joints.change[e] - rows.ratio[r] * step_out.joints.change[f]
            step_out.value[r] = -off / span
            found = wp.max(found, wp.abs(step_out.value[r]))
    return found


@wp.func
def give_couplers(
    begin: int,
    end: int,
    rows: RigidRows,
    poses_out: Poses,
    impulse_out: wp.array(dtype=wp.vec3d),
    step_out: RigidStep,
):
    """Apply the impulses of couplers to the rows of their rates, which count them among what acts in the freedoms."""
    for r in range(begin, end):
        if is_coupler(r, rows):
            for k in range(2):
                size = share_of(r, k, rows) * step_out.value[r]
                give_impulse(rows.part[r][k], size, False, rows, poses_out, impulse_out, step_out)
                step_out.joints.push[rows.part[r][k]] = step_out.joints.push[rows.part[r][k]] + size
