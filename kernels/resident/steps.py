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
from warp_mca.kernels.elements.patch import POINT, RESIDENT, Patches
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.nodes.constraint import Bonds, bond_function
from warp_mca.kernels.records.extremes import keep_normal_force
from warp_mca.kernels.resident.contact_role import Slaves, contact_role
from warp_mca.kernels.resident.master_role import Faces, master_role
from warp_mca.kernels.resident.meeting import FORCES, NODES, arrive, leave, together, wait_for
from warp_mca.kernels.resident.node_role import Nodes, free_role
from warp_mca.kernels.resident.patch_role import patch_role
from warp_mca.model.patches import PATCH

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
def bound_role(precision: str, contact: bool, partial: bool) -> Any:
    """The function that advances bound nodes and keeps the greatest normal force in each of some steps."""
    vec3 = scalars(precision).vec3
    advance_bond = bond_function(precision, contact, False, partial)

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
        contact_force_out: wp.array(dtype=wp.vec3d),
        normal_force_out: wp.array2d(dtype=wp.int64),
        u_out: wp.array(dtype=wp.vec3d),
        v_out: wp.array(dtype=wp.vec3d),
        v_before_out: wp.array(dtype=wp.vec3d),
        speed_square_out: wp.array(dtype=wp.float32),
        impulse_out: wp.array(dtype=wp.vec3d),
        work_out: wp.array(dtype=wp.vec3d),
        work_after_out: wp.array(dtype=wp.vec3d),
        clock_out: wp.array(dtype=wp.int32),
    ):
        for n in range(steps):
            wait_for(wp.static(FORCES), (n + 1) * pushers, count_out)
            if lane >= wp.static(PATCH - KEEPERS):
                keep_normal_force(lane - wp.static(PATCH - KEEPERS), wp.static(KEEPERS), normal_force_out)
            for k in range(lane, bonds.first.shape[0] + bonds.node.shape[0], wp.static(PATCH)):
                advance_bond(
                    k,
                    nodes.mass,
                    nodes.inverse_mass,
                    nodes.first_slots,
                    nodes.more_slots,
                    nodes.role,
                    force,
                    0,
                    nodes.gravity,
                    bonds,
                    dt,
                    contact_force_out,
                    u_out,
                    v_out,
                    v_before_out,
                    speed_square_out,
                    impulse_out,
                    work_out,
                    work_after_out,
                    clock_out,
                )
            arrive(wp.static(NODES), count_out)

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
    move_bound = bound_role(precision, contact, partial)

    @wp.kernel(
        enable_backward=False,
        module="unique",
        grid_stride=False,
        launch_bounds=(PATCH, RESIDENT[precision]),
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
        flowing_out: wp.array(dtype=wp.int32),
        force_out: wp.array(dtype=vec3),
        contact_force_out: wp.array(dtype=wp.vec3d),
        normal_force_out: wp.array2d(dtype=wp.int64),
        u_out: wp.array(dtype=wp.vec3d),
        v_out: wp.array(dtype=wp.vec3d),
        v_before_out: wp.array(dtype=wp.vec3d),
        speed_square_out: wp.array(dtype=wp.float32),
        impulse_out: wp.array(dtype=wp.vec3d),
        work_out: wp.array(dtype=wp.vec3d),
        work_after_out: wp.array(dtype=wp.vec3d),
        clock_out: wp.array(dtype=wp.int32),
        flag_out: wp.array2d(dtype=wp.int32),
    ):
        lane = wp.tid() & wp.static(PATCH - 1)
        block = wp.tid() // wp.static(PATCH)
        pushers = roles.master
        movers = roles.end - roles.master
        if block < roles.contact:
            compute_patch(
                block, lane, steps, movers, X, points, patches, law, slot, u_out,
                count_out, yielded_out, history_out, extreme_out, flowing_out, force_out,
            )  # fmt: skip
        elif block < roles.master:
            if wp.static(contact):
                item = (block - roles.contact) * wp.static(PATCH) + lane
                touch_slaves(
                    item, steps, movers, X, u_out, v_out, slaves, master, dt, spring,
                    count_out, contact_force_out, normal_force_out[1], flag_out,
                )  # fmt: skip
        elif block < roles.bound:
            if wp.static(contact):
                item = (block - roles.master) * wp.static(PATCH) + lane
                move_masters(
                    item, steps, pushers, nodes, faces, dt, force_out, spring,
                    count_out, u_out, v_out, speed_square_out, flag_out,
                )  # fmt: skip
        elif block < roles.free:
            move_bound(
                lane, steps, pushers, nodes, bonds, dt, force_out,
                count_out, contact_force_out, normal_force_out, u_out, v_out, v_before_out, speed_square_out,
                impulse_out, work_out, work_after_out, clock_out,
            )  # fmt: skip
        else:
            item = (block - roles.free) * wp.static(PATCH) + lane
            stride = (roles.end - roles.free) * wp.static(PATCH)
            move_free(
                item, stride, steps, pushers, nodes, dt, force_out,
                count_out, contact_force_out, u_out, v_out, speed_square_out,
            )  # fmt: skip
        leave(count_out)

    return together(resident_steps)
