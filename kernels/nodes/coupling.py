"""Owns the impulses of a joint between two bodies that answer as rigid ones at its point: pure functions.

An impulse J [N s] and an angular impulse T [N m s] at the point P of the joint change the velocity v of P and the
angular velocity w of a body by

    dv = point J + mixed T,   dw = mixed^T J + turn T.

The other body takes -J and -T at the same point, so that momentum and angular momentum are kept to rounding. With the
sums of both bodies' matrices, J and T solve v + dv = 0 and H (w + dw) = 0, T = H T, for the relative velocities v and w
and the projector H on the rotations that the joint holds: 0 for a ball joint, 1 - d d^T for a hinge about d, 1 for a
weld.
"""

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.struct
class Response:
    """How a body answers an impulse and an angular impulse at the point of a joint.

    Attributes:
        point: velocity of the point by an impulse [1/kg].
        mixed: velocity of the point by an angular impulse [1/(kg m)].
        turn: angular velocity by an angular impulse [1/(kg m^2)].
    """

    point: wp.mat33d
    mixed: wp.mat33d
    turn: wp.mat33d


@wp.func
def inertia_about(m: wp.float64, arm: wp.vec3d) -> wp.mat33d:
    """Inertia m (arm^2 - arm arm^T) of a mass at `arm` [kg m^2]."""
    return m * (wp.dot(arm, arm) * wp.identity(3, dtype=wp.float64) - wp.outer(arm, arm))


@wp.func
def sum_of(a: Response, b: Response) -> Response:
    """Response of the relative motion of two bodies."""
    found = Response()
    found.point = a.point + b.point
    found.mixed = a.mixed + b.mixed
    found.turn = a.turn + b.turn
    return found


@wp.func
def joint_impulses(response: Response, v: wp.vec3d, w: wp.vec3d, held: wp.mat33d):
    """J and T on the first body that take the relative velocities v [m/s] and, where `held`, w [rad/s] away.

    T comes from the Schur complement of `point`, which the free rotations, those that `held` projects on 0, leave out.
    """
    inverse_point = wp.inverse(response.point)
    free = wp.identity(3, dtype=wp.float64) - held
    across = wp.transpose(response.mixed) * inverse_point
    schur = held * (response.turn - across * response.mixed) * held
    scale = wp.trace(response.turn)
    T = held * (wp.inverse(schur + scale * free) * (held * (across * v - w)))
    J = -(inverse_point * (v + response.mixed * T))
    return J, T


@wp.func
def turned(q: wp.quatd, angle: wp.vec3d) -> wp.quatd:
    """Orientation q after a further rotation by the vector `angle` [rad]."""
    size = wp.length(angle)
    if size == wp.float64(0.0):
        return q
    half = wp.float64(0.5) * size
    part = (wp.sin(half) / size) * angle
    return wp.normalize(wp.quatd(part[0], part[1], part[2], wp.cos(half)) * q)
