"""Owns what viewers show of the state: stress at nodes, skins, probes, contact points, fields of the volume."""

import warp as wp

from warp_mca.kernels.contact.spring import Spring

vec6 = wp.types.vector(6, wp.float32)  # xx, yy, zz, xy, yz, xz
OPEN, SLIP, STICK = 0, 1, 2  # states of a contact point
_STICKING = 0.999999  # share of the limit of friction below which a point sticks


@wp.func
def von_mises(s: vec6) -> wp.float32:
    """Equivalent stress sqrt(3/2 S : S) [Pa]."""
    half = wp.float32(0.5)
    a = s[0] - s[1]
    b = s[1] - s[2]
    c = s[2] - s[0]
    shear = s[3] * s[3] + s[4] * s[4] + s[5] * s[5]
    return wp.sqrt(half * (a * a + b * b + c * c) + wp.float32(3.0) * shear)


@wp.kernel(enable_backward=False)
def nodal_stress(
    offset: wp.array(dtype=wp.int32),
    slot: wp.array(dtype=wp.int32),
    stress: wp.array2d(dtype=wp.float32),
    tensor_out: wp.array(dtype=vec6),
    von_mises_out: wp.array(dtype=wp.float32),
    plastic_out: wp.array(dtype=wp.float32),
):
    """Mean of the corner values of the elements around each node, and the von Mises stress of the mean.

    Nodes of rigid bodies have no elements, and show no stress.
    """
    i = wp.tid()
    total = vec6()
    plastic = wp.float32(0.0)
    for j in range(offset[i], offset[i + 1]):
        c = slot[j]
        for k in range(6):
            total[k] = total[k] + stress[k, c]
        plastic += stress[6, c]
    count = wp.float32(wp.max(offset[i + 1] - offset[i], 1))
    tensor_out[i] = total / count
    von_mises_out[i] = von_mises(total / count)
    plastic_out[i] = plastic / count


@wp.kernel(enable_backward=False)
def mark_failed(age: wp.array(dtype=wp.int32), first: int, failed_out: wp.array(dtype=wp.int32)):
    """1 for elements that have failed, whose `age` is below 0, from entry `first` on."""
    e = wp.tid()
    failed_out[first + e] = wp.where(age[e] < 0, 1, 0)


@wp.kernel(enable_backward=False)
def leave_out_failed(
    age: wp.array(dtype=wp.int32),
    element: wp.array(dtype=wp.int32),
    corners: int,
    first: int,
    stress_out: wp.array2d(dtype=wp.float32),
):
    """Mark corners of failed elements, from `first` on, so that means at nodes leave them out."""
    item = wp.tid()
    if age[element[item]] < 0:
        for a in range(corners):
            stress_out[6, first + corners * item + a] = wp.float32(-1.0)


@wp.kernel(enable_backward=False)
def stress_of_whole(
    offset: wp.array(dtype=wp.int32),
    slot: wp.array(dtype=wp.int32),
    stress: wp.array2d(dtype=wp.float32),
    tensor_out: wp.array(dtype=vec6),
    von_mises_out: wp.array(dtype=wp.float32),
    plastic_out: wp.array(dtype=wp.float32),
):
    """As `nodal_stress`, of elements that have not failed."""
    i = wp.tid()
    total = vec6()
    plastic = wp.float32(0.0)
    count = wp.float32(0.0)
    for j in range(offset[i], offset[i + 1]):
        c = slot[j]
        if stress[6, c] >= wp.float32(0.0):
            for k in range(6):
                total[k] = total[k] + stress[k, c]
            plastic += stress[6, c]
            count += wp.float32(1.0)
    count = wp.max(count, wp.float32(1.0))
    tensor_out[i] = total / count
    von_mises_out[i] = von_mises(total / count)
    plastic_out[i] = plastic / count


@wp.kernel(enable_backward=False)
def positions(
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    node: wp.array(dtype=wp.int32),
    point_out: wp.array(dtype=wp.vec3f),
):
    """Positions of some nodes [m]."""
    i = wp.tid()
    point_out[i] = wp.vec3f(X[node[i]] + u[node[i]])


@wp.kernel(enable_backward=False)
def displacements(u: wp.array(dtype=wp.vec3d), displacement_out: wp.array(dtype=wp.vec3f)):
    """Displacement of every node [m]."""
    i = wp.tid()
    displacement_out[i] = wp.vec3f(u[i])


@wp.kernel(enable_backward=False)
def velocities(v_before: wp.array(dtype=wp.vec3d), v: wp.array(dtype=wp.vec3d), velocity_out: wp.array(dtype=wp.vec3f)):
    """Velocity of every node at t(n) [m/s]: the mean of the half steps around it."""
    i = wp.tid()
    velocity_out[i] = wp.vec3f(wp.float64(0.5) * (v_before[i] + v[i]))


@wp.kernel(enable_backward=False)
def sample_probes(
    corner: wp.array2d(dtype=wp.int32),
    weight: wp.array2d(dtype=wp.float32),
    tensor: wp.array(dtype=vec6),
    row: wp.array(dtype=wp.int32),
    stress_out: wp.array2d(dtype=vec6),
    von_mises_out: wp.array(dtype=wp.float32),
):
    """Stress at points inside elements, interpolated between the corners: into a row of a ring, and the latest."""
    k = wp.tid()
    total = vec6()
    for a in range(corner.shape[1]):
        total += weight[k, a] * tensor[corner[k, a]]
    stress_out[row[0], k] = total
    von_mises_out[k] = von_mises(total)


@wp.kernel(enable_backward=False)
def contact_points(
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    slave: wp.array(dtype=wp.int32),
    mu: wp.float64,
    sides: int,
    first: int,
    spring: Spring,
    point_out: wp.array(dtype=wp.vec3f),
    state_out: wp.array(dtype=wp.int32),
):
    """Positions of the slave nodes of a pass [m], and whether each is open, slips or sticks (on any side)."""
    s = wp.tid()
    i = slave[s]
    point_out[first + s] = wp.vec3f(X[i] + u[i])
    state = int(wp.static(OPEN))
    for e in range(sides * s, sides * s + sides):
        force = spring.force[e]
        if wp.dot(force, force) > wp.float64(0.0):
            tangential = spring.tangential[e]
            normal = force - tangential
            most = wp.float64(_STICKING) * mu * wp.length(normal)
            if spring.limit.shape[0] > 0:
                most = wp.float64(_STICKING) * spring.limit[e]
            if wp.length(tangential) < most:
                state = int(wp.static(STICK))
            elif state == wp.static(OPEN):
                state = int(wp.static(SLIP))
    state_out[first + s] = state
