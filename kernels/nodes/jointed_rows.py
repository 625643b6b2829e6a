"""Owns the rows of a group of bodies that joints between whole bodies connect, beside those of `rigid_rows`.

All threads of a block take part: each takes some joints and bodies, one solves for the impulses.
"""

import warp as wp

from warp_mca.kernels.hardware.block import wait_for_block
from warp_mca.kernels.nodes.cluster import Clusters
from warp_mca.kernels.nodes.couplers import coupler_lightness, give_couplers, is_coupler, open_couplers
from warp_mca.kernels.nodes.joint_drives import count_loads, count_rates, push_joint
from warp_mca.kernels.nodes.rigid_joints import close_joint, place_joint
from warp_mca.kernels.nodes.rigid_motion import Poses, RigidBodies, RigidStep, find_motion
from warp_mca.kernels.nodes.rigid_pins import move_pin
from warp_mca.kernels.nodes.rigid_rows import SOLVES, RigidRows, give_impulses, opening, row_lightness
from warp_mca.kernels.nodes.symmetric import solve_factorised

SURE = 1e-7  # share of a row that counts as held by it alone: axes of a loop may be 3e-4 rad off


@wp.func
def move_bodies(
    k: int, lane: int, span: wp.float64, bodies: RigidBodies, rows: RigidRows, poses: Poses, step_out: RigidStep
):
    """Motions of the bodies of group k, for all threads of the block."""
    wait_for_block()
    for place in range(rows.body[k] + lane, rows.body[k + 1], wp.block_dim()):
        find_motion(rows.member[place], bodies, span, poses, step_out)
    wait_for_block()


@wp.func
def place_joints(
    k: int,
    lane: int,
    kick: wp.float64,
    span: wp.float64,
    moves: bool,
    bodies: RigidBodies,
    rows: RigidRows,
    poses_out: Poses,
    impulse_out: wp.array(dtype=wp.vec3d),
    step_out: RigidStep,
):
    """Rows of the joints of group k at t(n), and the motion of its bodies with what acts in the freedoms."""
    wait_for_block()
    for m in range(rows.joints.begin[k] + lane, rows.joints.begin[k + 1], wp.block_dim()):
        j = rows.joints.member[m]
        place_joint(j, span, moves, rows.joints, bodies, poses_out, step_out)
        push_joint(j, kick, wp.abs(span), moves, rows.joints, poses_out.joints, step_out.joints)
    wait_for_block()
    begin = rows.begin[k]
    end = rows.begin[k + 1]
    if lane == 0:
        for r in range(begin, end):
            step_out.value[r] = wp.float64(0.0)
            if rows.joint[r] >= 0:
                step_out.value[r] = step_out.joints.push[r]
        give_impulses(begin, end, False, rows, poses_out, impulse_out, step_out)
        for r in range(begin, end):
            if rows.joint[r] >= 0:
                step_out.joints.total[r] = wp.float64(0.0)
    move_bodies(k, lane, span, bodies, rows, poses_out, step_out)


@wp.func
def note_rank(k: int, rows: RigidRows, poses_out: Poses, step: RigidStep):
    """Keep how near joints of group k have come to a pose in which their rows hold fewer motions, see `JointState`."""
    if rows.joints.begin[k] == rows.joints.begin[k + 1]:
        return
    j = rows.joints.member[rows.joints.begin[k]]
    rank = wp.float64(0.0)
    least = wp.float64(1.0)
    for r in range(rows.begin[k], rows.begin[k + 1]):
        share = step.share[r]
        if rows.rate[r] < 0 and share > wp.float64(SURE):
            rank += wp.float64(1.0)
            least = wp.min(least, share)
    own = poses_out.joints.rank[j]
    clock = wp.float64(poses_out.joints.clock[j])
    if own[0] == wp.float64(0.0):
        own = wp.vec4d(rank, least, wp.float64(1.0), clock)
    near = least / own[1]
    if rank != own[0]:
        near = wp.float64(0.0)
        if rank > own[0]:  # it was so until now
            own[0] = rank
    if near < own[2]:
        own[2] = near
        own[3] = clock
    poses_out.joints.rank[j] = own


@wp.func
def jointed_lightness(r: int, s: int, bodies: RigidBodies, rows: RigidRows, moves: bool, step: RigidStep) -> wp.float64:
    """Entry of a group's matrix, see `rigid_rows.row_lightness`; rows of rates give way as `joint_drives` says."""
    e = rows.rate[r]
    f = rows.rate[s]
    if e >= 0:
        if step.joints.ahead[e] <= wp.float64(0.0):
            return wp.float64(0.0)
    if f >= 0:
        if step.joints.ahead[f] <= wp.float64(0.0):
            return wp.float64(0.0)
    if is_coupler(r, rows) or is_coupler(s, rows):
        return coupler_lightness(r, s, bodies, rows, moves, step)
    found = row_lightness(r, s, bodies, rows, moves, step)
    if e >= 0 and r == s:
        found += wp.float64(1.0) / step.joints.ahead[e]
    return found


@wp.func
def satisfy_joints(
    k: int,
    lane: int,
    span: wp.float64,
    counts: bool,
    bodies: RigidBodies,
    rows: RigidRows,
    clusters: Clusters,
    poses_out: Poses,
    impulse_out: wp.array(dtype=wp.vec3d),
    step_out: RigidStep,
):
    """As `rigid_rows.satisfy`, in a group with joints between whole bodies; then these are counted."""
    begin = rows.begin[k]
    end = rows.begin[k + 1]
    best = wp.float64(0.0)
    for step in range(SOLVES):
        if lane == 0:
            for p in range(rows.pins[k], rows.pins[k + 1]):
                move_pin(p, clusters, span, poses_out, step_out)
        wait_for_block()
        for m in range(rows.joints.begin[k] + lane, rows.joints.begin[k + 1], wp.block_dim()):
            close_joint(rows.joints.member[m], span, counts, rows.joints, poses_out, step_out)
        wait_for_block()
        if lane == 0:
            worst_row = opening(begin, end, span, counts, rows, clusters, poses_out, step_out)
            worst_row = open_couplers(begin, end, span, worst_row, rows, poses_out.joints, step_out)
            step_out.joints.worst[k] = worst_row
        wait_for_block()
        worst = step_out.joints.worst[k]
        if wp.abs(span) * worst <= rows.joints.rounding or (step > 0 and worst >= best):
            break
        best = worst
        if lane == 0:
            solve_factorised(rows.entry[k], end - begin, begin, step_out.matrix, step_out.value)
            give_impulses(begin, end, counts, rows, poses_out, impulse_out, step_out)
            give_couplers(begin, end, rows, poses_out, impulse_out, step_out)
        move_bodies(k, lane, span, bodies, rows, poses_out, step_out)
    for m in range(rows.joints.begin[k] + lane, rows.joints.begin[k + 1], wp.block_dim()):
        j = rows.joints.member[m]
        if counts:
            Q = poses_out.rotation[wp.max(rows.joints.body[j], 0)]
            if rows.joints.soft[j] == 1:
                Q = poses_out.orientation[rows.joints.pin[j]]
            count_loads(j, Q, rows.joints, poses_out.joints, step_out.joints)
            count_rates(j, span, rows.joints, poses_out.joints, step_out.joints)
        else:
            for e in range(rows.joints.rate[j], rows.joints.rate[j + 1]):
                poses_out.joints.rate[e] = step_out.joints.change[e] / span
