"""Owns the kernel that takes many steps in one launch, for models that a GPU holds at once.

Blocks of threads keep their roles from step to step: patches of elements and slave nodes of a contact give forces;
master, bound and free nodes move. Blocks that move nodes wait for all forces of a step; blocks that give forces wait
for all nodes. All blocks must be on the device together (`warp_mca.step.resident`).
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.laws import Laws
from warp_mca.kernels.contact.nearest import Master
from warp_mca.kernels.contact.spring import Spring
from warp_mca.kernels.elements.patch import POINT, Patches
from warp_mca.kernels.elements.patch_kernel import Maker
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.nodes.cluster import Clusters
from warp_mca.kernels.nodes.constraint import Bonds
from warp_mca.kernels.nodes.gather import NodeState
from warp_mca.kernels.resident.bound_role import bound_role
from warp_mca.kernels.resident.contact_role import Slaves, contact_role
from warp_mca.kernels.resident.master_role import Faces, master_role
from warp_mca.kernels.resident.meeting import leave, together
from warp_mca.kernels.resident.node_role import Nodes, free_role
from warp_mca.kernels.resident.patch_role import RESIDENT, THREADS, patch_role
from warp_mca.kernels.resident.pin_role import pin_role


@wp.struct
class Roles:
    """First block of threads of each role except patches, which come first, and the number of blocks.

    Attributes:
        contact: slave nodes.
        master: nodes of master faces.
        bound: bound nodes, and the greatest normal force: one block, or none.
        pin: nodes of hinges with pins.
        free: other nodes.
        end: number of blocks.
    """

    contact: wp.int32
    master: wp.int32
    bound: wp.int32
    pin: wp.int32
    free: wp.int32
    end: wp.int32


@cache
def resident_kernel(
    maker: Maker,
    precision: str,
    law_name: str,
    viscous: int,
    turned: bool,
    contact: bool,
    friction: bool,
    contact_laws: Laws,
    partial: bool,
    driven: bool,
    coupled: bool,
) -> Any:
    """Kernel: take `steps` steps of a model of one block of hexahedra, with contact if `contact`, pins if `coupled`.

    Arguments are those of the kernels that take the same steps one by one: `patch_kernel`, `contact`, `nodes.node`,
    `nodes.constraint`, `nodes.couple`. `viscous`: elements have bulk viscosity; `turned`: they compute in floating
    frames; `driven`: some nodes are. count_out are the counts of `meeting`, zero before and after. `maker` makes the
    element, see `patch_kernel.PatchElement`.
    """
    t = scalars(precision)
    R, vec3, point = t.real, t.vec3, POINT[precision]
    compute_patch = patch_role(maker, precision, law_name, viscous, turned)
    move_free = free_role(precision, contact, turned)
    touch_slaves, move_masters = contact_role(friction, contact_laws), master_role(precision, turned)
    move_bound, move_pinned = bound_role(precision, partial, turned, driven), pin_role(precision, turned)

    @wp.func
    def give_forces(
        block: int,
        lane: int,
        steps: int,
        roles: Roles,
        X: wp.array(dtype=wp.vec3d),
        points: wp.array(dtype=point),
        patches: Patches,
        law: wp.array2d(dtype=R),
        slot: int,
        nodes: Nodes,
        slaves: Slaves,
        master: Master,
        dt: wp.float64,
        spring: Spring,
        count_out: wp.array(dtype=wp.int32),
        yielded_out: wp.array(dtype=wp.int32),
        history_out: wp.array2d(dtype=R),
        extreme_out: wp.array2d(dtype=R),
        force_out: wp.array(dtype=vec3),
        state_out: NodeState,
        normal_force_out: wp.array(dtype=wp.int64),
        flag_out: wp.array2d(dtype=wp.int32),
    ):
        """Forces of patches and slave nodes."""
        movers = roles.end - roles.master
        if block < roles.contact:
            compute_patch(
                block, lane, steps, movers, X, points, patches, law, slot, nodes, state_out.u,
                count_out, yielded_out, history_out, extreme_out, force_out,
            )  # fmt: skip
        elif wp.static(contact):
            touch_slaves(
                block - roles.contact, lane, steps, movers, X, slaves, master, dt, spring,
                count_out, state_out, normal_force_out, flag_out,
            )  # fmt: skip

    @wp.func
    def move_nodes(
        block: int,
        lane: int,
        steps: int,
        roles: Roles,
        nodes: Nodes,
        faces: Faces,
        bonds: Bonds,
        clusters: Clusters,
        X: wp.array(dtype=wp.vec3d),
        dt: wp.float64,
        force: wp.array(dtype=vec3),
        spring: Spring,
        count_out: wp.array(dtype=wp.int32),
        normal_force_out: wp.array2d(dtype=wp.int64),
        state_out: NodeState,
        impulse_out: wp.array(dtype=wp.vec3d),
        work_out: wp.array(dtype=wp.vec3d),
        work_after_out: wp.array(dtype=wp.vec3d),
        clock_out: wp.array(dtype=wp.int32),
        place_out: wp.array(dtype=wp.vec3d),
        orientation_out: wp.array2d(dtype=wp.quatd),
        flag_out: wp.array2d(dtype=wp.int32),
    ):
        """Motion of master, bound, pinned and free nodes."""
        pushers = roles.master
        if block < roles.bound:
            if wp.static(contact):
                move_masters(
                    block - roles.master, lane, steps, pushers, nodes, faces, dt, force, spring,
                    count_out, state_out, flag_out,
                )  # fmt: skip
        elif block < roles.pin:
            move_bound(
                lane, steps, pushers, nodes, bonds, dt, force, count_out, normal_force_out, state_out,
                impulse_out, work_out, work_after_out, clock_out,
            )  # fmt: skip
        elif block < roles.free:
            if wp.static(coupled):
                move_pinned(
                    block - roles.pin, lane, steps, pushers, nodes, clusters, X, dt, force, count_out, state_out,
                    impulse_out, place_out, orientation_out,
                )  # fmt: skip
        else:
            move_free(
                block - roles.free, lane, roles.end - roles.free, steps, pushers, nodes, dt, force,
                count_out, state_out,
            )  # fmt: skip

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
        clusters: Clusters,
        dt: wp.float64,
        spring: Spring,
        count_out: wp.array(dtype=wp.int32),
        yielded_out: wp.array(dtype=wp.int32),
        history_out: wp.array2d(dtype=R),
        extreme_out: wp.array2d(dtype=R),
        force_out: wp.array(dtype=vec3),
        normal_force_out: wp.array2d(dtype=wp.int64),
        state_out: NodeState,
        impulse_out: wp.array(dtype=wp.vec3d),
        work_out: wp.array(dtype=wp.vec3d),
        work_after_out: wp.array(dtype=wp.vec3d),
        clock_out: wp.array(dtype=wp.int32),
        place_out: wp.array(dtype=wp.vec3d),
        orientation_out: wp.array2d(dtype=wp.quatd),
        flag_out: wp.array2d(dtype=wp.int32),
    ):
        lane = wp.tid() % wp.static(THREADS)
        block = wp.tid() // wp.static(THREADS)
        if block < roles.master:
            give_forces(
                block, lane, steps, roles, X, points, patches, law, slot, nodes, slaves, master, dt,
                spring, count_out, yielded_out, history_out, extreme_out, force_out, state_out,
                normal_force_out[wp.static(1 if contact else 0)], flag_out,
            )  # fmt: skip
        else:
            move_nodes(
                block, lane, steps, roles, nodes, faces, bonds, clusters, X, dt, force_out, spring,
                count_out, normal_force_out, state_out,
                impulse_out, work_out, work_after_out, clock_out, place_out, orientation_out, flag_out,
            )  # fmt: skip
        leave(count_out)

    return together(resident_steps)
