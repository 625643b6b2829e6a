"""Owns the deliberate errors in rigid bodies of the impact phase."""

from __future__ import annotations

from benchmarks.deliberate.mutation import Mutation

RIGID_MUTATIONS: dict[str, Mutation] = {
    "spin_term_dropped": Mutation(
        "the rotation of a rigid body forgets the gyroscopic term f x J f",
        "kernels/nodes/rigid_motion.py",
        "off = Jf + wp.cross(f, Jf) - ",
        "off = Jf - ",
    ),
    "rigid_gravity_halved": Mutation(
        "a rigid body feels half of gravity",
        "kernels/nodes/rigid_body.py",
        "kick * (sum_F + weight)",
        "kick * (sum_F + wp.float64(0.5) * weight)",
    ),
    "row_forgets_second": Mutation(
        "joints between rigid bodies give the second one no moment",
        "kernels/nodes/rigid_rows.py",
        "poses_out.spin[b] - size *",
        "poses_out.spin[b] - wp.float64(0.0) * size *",
    ),
}
