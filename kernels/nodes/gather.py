"""Owns what all kernels that move nodes share: gathering the forces on a node, kicking it with them and moving it.

A step is that of central differences with lumped mass,

    v(n+1/2) = v(n-1/2) + kick a(n),   a = f / m + g,   u(n+1) = u(n) + drift v(n+1/2),

where f is the sum of the forces that elements wrote to slots of their own, in a fixed order, so that runs repeat bit
for bit, and of the nodal force, to which anything else may add before nodes move.
"""

from functools import cache
from typing import Any, NamedTuple

import warp as wp

from warp_mca.kernels.hardware.per_scene import kind, value_function
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.nodes.floating import Frames, turn_function
from warp_mca.kernels.records.extremes import keep_speed

# In the role of a node, whose lowest three bits are its axes at rest:
BOUND = 8  # another kernel than `node.integrate_kernel` advances it
TOUCHABLE = 16  # it may have a nodal force

LEVEL_BIT = 27  # first bit of a level beside the number of a node or a slot, see `split_level`


class Kind(NamedTuple):
    """What the kernels that move the nodes of a model are compiled for.

    Attributes:
        precision: of the forces of elements, "mixed" or "float64".
        pushed: whether nodes may have nodal forces.
        each: whether gravity differs between the scenes of a batch, whose nodes then know their scene.
        rated: whether elements take steps of their own: slots come with levels, and a node may have none.
        turned: whether the forces of elements are those in floating frames.
    """

    precision: str
    pushed: bool = False
    each: bool = False
    rated: bool = False
    turned: bool = False


@wp.struct
class NodeData:
    """What does not change while nodes move.

    Attributes:
        mass, inverse_mass: [kg], [1/kg], shape (node_count,), float64.
        first_slots, more_slots: slots of the forces on each node, see `elements.stage.gather_lists`; with rates those
            of the elements that act in this substep.
        role: axes at rest, BOUND and TOUCHABLE, shape (node_count,), uint8; empty where no node has any.
        frames: floating frames.
    """

    mass: wp.array(dtype=wp.float64)
    inverse_mass: wp.array(dtype=wp.float64)
    first_slots: wp.array(dtype=wp.vec2i)
    more_slots: wp.array(dtype=wp.vec4i)
    role: wp.array(dtype=wp.uint8)
    frames: Frames


@wp.struct
class NodeState:
    """What changes as nodes move.

    Attributes:
        nodal_force: forces that do not come from elements [N], shape (node_count,), vec3d; zero between steps, empty
            without any.
        u: displacement [m], shape (node_count,), vec3d.
        v: velocity at the latest half step [m/s], shape (node_count,), vec3d.
        v_before: takes the velocity before the step [m/s], shape (node_count,), vec3d, where it is not empty.
        speed_square: greatest v^2 so far, see `extremes.keep_speed` [m^2/s^2], float32.
    """

    nodal_force: wp.array(dtype=wp.vec3d)
    u: wp.array(dtype=wp.vec3d)
    v: wp.array(dtype=wp.vec3d)
    v_before: wp.array(dtype=wp.vec3d)
    speed_square: wp.array(dtype=wp.float32)


@wp.func
def split_level(item: int):
    """Number below LEVEL_BIT, and 2^level of the bits from there on."""
    return item & wp.static((1 << LEVEL_BIT) - 1), wp.float64(1 << (item >> wp.static(LEVEL_BIT)))


@cache
def force_function(precision: str, rated: bool) -> Any:
    """The function that reads the force in a slot; `rated`: 2^k times it, where k is the level beside the slot."""
    vec3 = scalars(precision).vec3

    @wp.func
    def force_at(slot: int, force: wp.array(dtype=vec3)):
        f = force[slot]
        return wp.vec3d(wp.float64(f[0]), wp.float64(f[1]), wp.float64(f[2]))

    @wp.func
    def impulse_at(entry: int, force: wp.array(dtype=vec3)):
        slot, scale = split_level(entry)
        return scale * force_at(slot, force)

    return impulse_at if rated else force_at


@cache
def gather_function(precision: str, rated: bool = False) -> Any:
    """The function that sums the forces of elements on a node.

    Most nodes have one or two slots, whose forces a thread loads at the same time.
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
def element_force_function(own: Kind) -> Any:
    """The function that sums the forces of elements on node i, whose first slots are `pair` [N]."""
    vec3 = scalars(own.precision).vec3
    gather, to_world = gather_function(own.precision, own.rated), turn_function(own.turned)

    @wp.func
    def element_force(i: int, pair: wp.vec2i, nodes: NodeData, force: wp.array(dtype=vec3)):
        return to_world(i, gather(pair, nodes.more_slots, force), nodes.frames)

    return element_force


@cache
def nodal_force_function(pushed: bool) -> Any:
    """The function that adds the nodal force of node i to the other forces, and clears it."""

    @wp.func
    def with_nodal_force(i: int, total: wp.vec3d, nodes: NodeData, nodal_force_out: wp.array(dtype=wp.vec3d)):
        if wp.static(pushed):
            if int(nodes.role[i]) & wp.static(TOUCHABLE) != 0:
                f = nodal_force_out[i]
                if f[0] != wp.float64(0.0) or f[1] != wp.float64(0.0) or f[2] != wp.float64(0.0):
                    nodal_force_out[i] = wp.vec3d()
                total += f
        return total

    return with_nodal_force


@cache
def total_force_function(own: Kind) -> Any:
    """The function that sums all forces on node i [N]: those of elements, then the nodal force."""
    vec3 = scalars(own.precision).vec3
    element_force, with_nodal_force = element_force_function(own), nodal_force_function(own.pushed)

    @wp.func
    def total_force(
        i: int,
        pair: wp.vec2i,
        nodes: NodeData,
        force: wp.array(dtype=vec3),
        nodal_force_out: wp.array(dtype=wp.vec3d),
    ):
        return with_nodal_force(i, element_force(i, pair, nodes, force), nodes, nodal_force_out)

    return total_force


@wp.func
def hold(role: int, a: wp.vec3d):
    """The acceleration without that of the axes at rest."""
    for k in range(3):
        if (role >> k) & 1 != 0:
            a[k] = wp.float64(0.0)
    return a


@cache
def acceleration_function(each: bool, fixed: bool = True) -> Any:
    """The function that gives the acceleration of a node under all forces on it [m/s^2]; `fixed`: axes may rest."""
    of, Vector, Index = value_function(each), kind(wp.vec3d, each), kind(wp.int32, each)

    @wp.func
    def acceleration(i: int, total: wp.vec3d, inverse: wp.float64, nodes: NodeData, scene: Index, gravity: Vector):
        a = inverse * total + of(gravity, of(scene, i))
        if wp.static(fixed):
            a = hold(int(nodes.role[i]), a)
        return a

    return acceleration


@wp.func
def move(i: int, u: wp.vec3d, v: wp.vec3d, state_out: NodeState):
    """Give node i its displacement [m] and velocity [m/s]."""
    if state_out.v_before.shape[0] > 0:
        state_out.v_before[i] = state_out.v[i]
    state_out.v[i] = v
    state_out.u[i] = u
    keep_speed(i, v, state_out.speed_square)
