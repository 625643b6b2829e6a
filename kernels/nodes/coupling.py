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


@wp.struct
class Inverse:
    """Solves for the impulses of a joint, see `joint_impulses`.

    Attributes:
        point: inverse of `Response.point` of the relative motion [kg].
        mixed: `Response.mixed` [1/(kg m)].
        across: mixed^T point [1/m].
        turn: inverse of the Schur complement of `Response.point` where rotations are held [kg m^2].
        held: projector on the rotations that the joint holds [-].
    """

    point: wp.mat33d
    mixed: wp.mat33d
    across: wp.mat33d
    turn: wp.mat33d
    held: wp.mat33d


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
def inverse_of(response: Response, held: wp.mat33d) -> Inverse:
    """What gives the impulses of a joint for the response of the relative motion; `held` projects on the directions
    about which it holds rotations.

    T comes from the Schur complement of `point`, without the free rotations, which `held` projects on 0.
    """
    found = Inverse()
    found.point = wp.inverse(response.point)
    found.mixed = response.mixed
    found.held = held
    found.across = wp.transpose(response.mixed) * found.point
    schur = held * (response.turn - found.across * response.mixed) * held
    free = wp.identity(3, dtype=wp.float64) - held
    found.turn = wp.inverse(schur + wp.trace(response.turn) * free)
    return found


@wp.func
def joint_impulses(inverse: Inverse, v: wp.vec3d, w: wp.vec3d):
    """J and T on the first body that cancel the relative velocities v [m/s] and, where held, w [rad/s]."""
    T = inverse.held * (inverse.turn * (inverse.held * (inverse.across * v - w)))
    J = -(inverse.point * (v + inverse.mixed * T))
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
