"""Owns the contact law along the surface: stick-slip up to a limit, Coulomb's or that of `friction_laws`."""

import warp as wp


@wp.func
def stick_slip(
    f_old: wp.vec3d, du: wp.vec3d, normal: wp.vec3d, limit: wp.float64, k: wp.float64
) -> tuple[wp.vec3d, wp.float64, int]:
    """Return mapping on the tangential spring.

    Args:
        f_old: tangential force on the slave so far [N].
        du: motion of the slave relative to the master since then [m].
        normal: unit normal of the master.
        limit: of the force, mu F_n by Coulomb's law [N].
        k: stiffness of the spring [N/m].

    Returns:
        The tangential force [N]; the energy that slip dissipated [J], trapezoidal as central differences count
        work; 1 where the point sticks.
    """
    f_start = f_old - wp.dot(f_old, normal) * normal
    trial = f_start - k * (du - wp.dot(du, normal) * normal)
    size = wp.length(trial)
    f = trial
    stick = int(1)
    if size > limit:
        f = (limit / size) * trial
        stick = int(0)
    work = wp.float64(0.5) * wp.dot(f_start + f, trial - f) / k
    return f, work, stick


@wp.func
def release(f_old: wp.vec3d, du: wp.vec3d, k: wp.float64) -> wp.float64:
    """Energy [J] that goes when a contact opens: what the tangential spring held, less its work over the last du [m].

    It is the dissipation of `stick_slip` for a limit of zero.
    """
    return wp.float64(0.5) * (wp.dot(f_old, f_old) / k - wp.dot(f_old, du))
