"""Owns the nodal stage: forces gathered from the elements, velocity and displacement advanced."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.early_launch import begins_early, let_next_begin, wait_for_previous
from warp_mca.kernels.hardware.per_scene import kind, value_function
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.nodes.floating import Frames, turn_function
from warp_mca.kernels.records.extremes import keep_normal_force, keep_speed

wp.set_module_options({"enable_backward": False})

# In the role of a node, whose lowest three bits are its axes at rest:
BOUND = 8  # `kernels.nodes.constraint` or `absorbing` advances it
TOUCHABLE = 16  # it belongs to a surface of a contact

LEVEL_BIT = 27  # first bit of a level beside the number of a node or a slot, see `rated_node`
KEEPERS = 32  # threads that keep the greatest normal force of each scene


@cache
def force_function(precision: str, rated: bool) -> Any:
    """The function that reads the force in a slot; `rated`: 2^k times it, with k in the bits from LEVEL_BIT on."""
    vec3 = scalars(precision).vec3

    @wp.func
    def force_at(slot: int, force: wp.array(dtype=vec3)):
        f = force[slot]
        return wp.vec3d(wp.float64(f[0]), wp.float64(f[1]), wp.float64(f[2]))

    @wp.func
    def impulse_at(entry: int, force: wp.array(dtype=vec3)):
        f = force_at(entry & wp.static((1 << LEVEL_BIT) - 1), force)
        return wp.float64(1 << (entry >> wp.static(LEVEL_BIT))) * f

    return impulse_at if rated else force_at


@cache
def gather_function(precision: str, rated: bool = False) -> Any:
    """The function that sums the forces of elements on a node, in the slots that `first_slots` and `more_slots` list.

    Most nodes have one or two, whose forces a thread has under way at once; see `elements.stage.gather_lists`. `rated`:
    slots come with levels, and a node may have none.
    """
    vec3, force_at = scalars(precision).vec3, force_function(precision, rated)

    @wp.func
    def gather(pair: wp.vec2i, more_slots: wp.array(dtype=wp.vec4i), force: wp.array(dtype=vec3)):
        if wp.static(rated):
            if pair[0] < 0:
                return wp.vec3d()
        total = force_at(pair[0], force)
        second = force_at(wp.max(pair[1], 0), force)
        if pair[1] >= 0:
            total += second
        row = -2 - pair[1]
        end = row
        if row >= 0:
            end += more_slots[row][3]
        while row < end:
            r = more_slots[row]
            total += force_at(r[0], force)
            if r[1] >= 0:
                total += force_at(r[1], force)
            if r[2] >= 0:
                total += force_at(r[2], force)
            row += 1
        return total

    return gather


@cache
def nodal_force_function(precision: str, rated: bool = False, turned: bool = False) -> Any:
    """The function that sums the forces of elements on node i as `gather_function` does.

    `turned`: they are those in its floating frame, from which their sum turns to the world's.
    """
    vec3, gather, to_world = scalars(precision).vec3, gather_function(precision, rated), turn_function(turned)

    @wp.func
    def nodal_force(
        i: int, pair: wp.vec2i, more_slots: wp.array(dtype=wp.vec4i), force: wp.array(dtype=vec3), frames: Frames
    ):
        return to_world(i, gather(pair, more_slots, force), frames)

    return nodal_force


@wp.func
def take_contact(i: int, contact_force_out: wp.array(dtype=wp.vec3d)):
    """The contact force on a node, which is given once."""
    fc = contact_force_out[i]
    if fc[0] != wp.float64(0.0) or fc[1] != wp.float64(0.0) or fc[2] != wp.float64(0.0):
        contact_force_out[i] = wp.vec3d()
    return fc


@wp.func
def hold(role: int, a: wp.vec3d):
    """The acceleration without that of the axes at rest."""
    for k in range(3):
        if (role >> k) & 1 != 0:
            a[k] = wp.float64(0.0)
    return a


@cache
def integrate_kernel(
    precision: str,
    contact: bool,
    fixed: bool,
    bound: bool = False,
    each: bool = False,
    early: bool = False,
    turned: bool = False,
) -> Any:
    """Kernel: central difference with lumped mass. v(n+1/2) = v(n-1/2) + kick a(n); u(n+1) = u(n) + drift v(n+1/2).

    Each node sums its element forces in a fixed order, so that runs repeat bit for bit. v_before_out takes v(n-1/2),
    where it is not empty. speed_square_out keeps the greatest v^2, see `extremes.keep_speed`. With `contact`, KEEPERS
    threads beyond the first range of nodes run `extremes.keep_normal_force`. `fixed`: some axes are at rest; `bound`:
    some nodes are left to `constraint.bound_kernel` or `absorbing.absorbing_kernel`. With `each`, gravity differs
    between the scenes of a batch, and nodes know their scene. `early`: the next kernel takes its places as soon as
    nodes leave some. `turned` as in `nodal_force_function`.
    """
    of, Vector, Index = value_function(each), kind(wp.vec3d, each), kind(wp.int32, each)
    vec3 = scalars(precision).vec3
    nodal_force = nodal_force_function(precision, False, turned)

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False)
    def integrate(
        inverse_mass: wp.array(dtype=wp.float64),
        first_slots: wp.array(dtype=wp.vec2i),
        more_slots: wp.array(dtype=wp.vec4i),
        role: wp.array(dtype=wp.uint8),
        force: wp.array(dtype=vec3),
        frames: Frames,
        scene: Index,
        gravity: Vector,
        kick: wp.float64,
        drift: wp.float64,
        contact_force_out: wp.array(dtype=wp.vec3d),
        u_out: wp.array(dtype=wp.vec3d),
        v_out: wp.array(dtype=wp.vec3d),
        v_before_out: wp.array(dtype=wp.vec3d),
        speed_square_out: wp.array(dtype=wp.float32),
        normal_force_out: wp.array2d(dtype=wp.int64),
    ):
        if wp.static(early):
            let_next_begin()
        i = wp.tid()
        beyond = i - u_out.shape[0]
        if wp.static(contact):
            i = wp.min(i, u_out.shape[0] - 1)
        pair = first_slots[i]
        inverse = inverse_mass[i]
        wait_for_previous()
        if wp.static(contact):
            if beyond >= 0:  # no node waits for the sums
                keep_normal_force(beyond, wp.static(KEEPERS), normal_force_out)
                return
        if wp.static(bound):
            if int(role[i]) & wp.static(BOUND) != 0:
                return
        total = nodal_force(i, pair, more_slots, force, frames)
        if wp.static(contact):
            if int(role[i]) & wp.static(TOUCHABLE) != 0:
                total += take_contact(i, contact_force_out)
        a = inverse * total + of(gravity, of(scene, i))
        if wp.static(fixed):
            a = hold(int(role[i]), a)
        v = v_out[i] + kick * a
        if v_before_out.shape[0] > 0:
            v_before_out[i] = v_out[i]
        v_out[i] = v
        u_out[i] = u_out[i] + drift * v
        keep_speed(i, v, speed_square_out)

    return begins_early(integrate)
