"""Owns the kernel that takes many steps in one launch, for models that a GPU holds at once.

Blocks of threads keep their roles from step to step: patches of elements and slave nodes of a contact give forces;
master, bound and free nodes move. Those that move nodes wait for all forces of a step, and those that give forces for
all nodes. All blocks must be on the device together (`warp_mca.solve.resident`).
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.nearest import Master
from warp_mca.kernels.contact.spring import Spring
from warp_mca.kernels.elements.patch import POINT, Patches
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.nodes.constraint import Bonds, BoundMotion, bond_functions, bound_node, other_node
from warp_mca.kernels.records.extremes import keep_normal_force, keep_speed
from warp_mca.kernels.resident.contact_role import Slaves, contact_role
from warp_mca.kernels.resident.master_role import Faces, master_role
from warp_mca.kernels.resident.meeting import FORCES, NODES, arrive, leave, together, wait_for
from warp_mca.kernels.resident.node_role import Nodes, free_role, gather_function, hold_node
from warp_mca.kernels.resident.patch_role import RESIDENT, THREADS, patch_role

wp.set_module_options({"enable_backward": False})

KEEPERS = 32  # threads that keep the greatest normal force


@wp.struct
class Roles:
    """First block of threads of each role but that of patches, and the number of blocks.

    Attributes:
        contact: slave nodes.
        master: nodes of master faces.
        bound: bound nodes, and the greatest normal force: one block, or none.
        free: other nodes.
        end: number of blocks.
    """

    contact: wp.int32
    master: wp.int32
    bound: wp.int32
    free: wp.int32
    end: wp.int32


@cache
def bound_role(precision: str, partial: bool) -> Any:
    """The function that advances bound nodes and keeps the greatest normal force in each of some steps."""
    vec3 = scalars(precision).vec3
    gather_held = gather_function(precision)
    bound_at, bound_motion = bond_functions(False, partial)

    @wp.func
    def known(
        i: int,
        nodes: Nodes,
        u: wp.array(dtype=wp.vec3d),
        v: wp.array(dtype=wp.vec3d),
    ):
        return bound_at(i, nodes.mass, nodes.inverse_mass, nodes.role, 0, nodes.gravity, u, v)

    @wp.func
    def move_bound(
        lane: int,
        steps: int,
        pushers: int,
        nodes: Nodes,
        bonds: Bonds,
        dt: wp.float64,
        force: wp.array(dtype=vec3),
        count_out: wp.array(dtype=wp.int32),
        normal_force_out: wp.array2d(dtype=wp.int64),
        u_out: wp.array(dtype=wp.vec3d),
        v_out: wp.array(dtype=wp.vec3d),
        speed_square_out: wp.array(dtype=wp.float32),
        impulse_out: wp.array(dtype=wp.vec3d),
        work_out: wp.array(dtype=wp.vec3d),
        work_after_out: wp.array(dtype=wp.vec3d),
        clock_out: wp.array(dtype=wp.int32),
    ):
        """A thread for each pair and driven node, in one block; the last threads of it keep the normal force."""
        mine = lane < bonds.first.shape[0] + bonds.node.shape[0]
        i = int(-1)
        j = int(-1)
        if mine:
            i = bound_node(lane, bonds)
            j = other_node(lane, bonds)
        held = hold_node(wp.max(i, 0), nodes)
        other_held = hold_node(wp.max(j, 0), nodes)
        for n in range(steps):
            one = known(i, nodes, u_out, v_out)
            other = known(j, nodes, u_out, v_out)
            motion = BoundMotion()
            wait_for(wp.static(FORCES), (n + 1) * pushers, count_out)
            if mine:
                total = gather_held(held, nodes.more_slots, force)
                other_total = gather_held(other_held, nodes.more_slots, force)
                motion = bound_motion(
                    lane, one, other, total, other_total, bonds, dt, work_out, work_after_out, clock_out
                )
                v_out[i] = motion.v
                u_out[i] = motion.u
                if j >= 0:
                    v_out[j] = motion.other_v
                    u_out[j] = motion.other_u
            if lane >= wp.static(THREADS - KEEPERS):
                keep_normal_force(lane - wp.static(THREADS - KEEPERS), wp.static(KEEPERS), normal_force_out)
            arrive(wp.static(NODES), count_out)
            if mine:  # no node waits for what is counted
                if lane < bonds.first.shape[0]:
                    impulse_out[lane] = impulse_out[lane] + motion.push
                keep_speed(i, motion.v, speed_square_out)
                if j >= 0:
                    keep_speed(j, motion.other_v, speed_square_out)

    return move_bound


@cache
def resident_kernel(
    precision: str, law_name: str, contact: bool, friction: bool, stress_free: bool, contact_law: str, partial: bool
) -> Any:
    """Kernel: `steps` steps of a model of one block of `hex8`, with a contact pass if `contact`.

    Arguments are those of the kernels that take the same steps one by one: `hex8_patch`, `contact`, `nodes.node`,
    `nodes.constraint`. count_out are the counts of `meeting`, zero before and after.
    """
    t = scalars(precision)
    R, vec3, point = t.real, t.vec3, POINT[precision]
    compute_patch, move_free = patch_role(precision, law_name), free_role(precision, contact)
    touch_slaves, move_masters = contact_role(friction, stress_free, contact_law), master_role(precision)
    move_bound = bound_role(precision, partial)

    @wp.kernel(
        enable_backward=False,
        module="unique",
        grid_stride=False,
        launch_bounds=(THREADS, RESIDENT),
        module_options={"fast_math": True},
    )
    def resident_steps(
        roles: Roles,
        steps: int,
        X: wp.array(dtype=wp.vec3d),
        points: wp.array(dtype=point),
        patches: Patches,
        law: wp.array2d(dtype=R),
        slot: int,
        nodes: Nodes,
        slaves: Slaves,
        master: Master,
        faces: Faces,
        bonds: Bonds,
        dt: wp.float64,
        spring: Spring,
        count_out: wp.array(dtype=wp.int32),
        yielded_out: wp.array(dtype=wp.int32),
        history_out: wp.array2d(dtype=R),
        extreme_out: wp.array2d(dtype=R),
        force_out: wp.array(dtype=vec3),
        contact_force_out: wp.array(dtype=wp.vec3d),
        normal_force_out: wp.array2d(dtype=wp.int64),
        u_out: wp.array(dtype=wp.vec3d),
        v_out: wp.array(dtype=wp.vec3d),
        speed_square_out: wp.array(dtype=wp.float32),
        impulse_out: wp.array(dtype=wp.vec3d),
        work_out: wp.array(dtype=wp.vec3d),
        work_after_out: wp.array(dtype=wp.vec3d),
        clock_out: wp.array(dtype=wp.int32),
        flag_out: wp.array2d(dtype=wp.int32),
    ):
        lane = wp.tid() % wp.static(THREADS)
        block = wp.tid() // wp.static(THREADS)
        pushers = roles.master
        movers = roles.end - roles.master
        if block < roles.contact:
            compute_patch(
                block, lane, steps, movers, X, points, patches, law, slot, u_out,
                count_out, yielded_out, history_out, extreme_out, force_out,
            )  # fmt: skip
        elif block < roles.master:
            if wp.static(contact):
                touch_slaves(
                    block - roles.contact, lane, steps, movers, X, u_out, v_out, slaves, master, dt, spring,
                    count_out, contact_force_out, normal_force_out[1], flag_out,
                )  # fmt: skip
        elif block < roles.bound:
            if wp.static(contact):
                move_masters(
                    block - roles.master, lane, steps, pushers, nodes, faces, dt, force_out, spring,
                    count_out, u_out, v_out, speed_square_out, flag_out,
                )  # fmt: skip
        elif block < roles.free:
            move_bound(
                lane, steps, pushers, nodes, bonds, dt, force_out,
                count_out, normal_force_out, u_out, v_out, speed_square_out,
                impulse_out, work_out, work_after_out, clock_out,
            )  # fmt: skip
        else:
            move_free(
                block - roles.free, lane, roles.end - roles.free, steps, pushers, nodes, dt, force_out,
                count_out, contact_force_out, u_out, v_out, speed_square_out,
            )  # fmt: skip
        leave(count_out)

    return together(resident_steps)
