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
    "loop_forgets_turning": Mutation(
        "loops of a machine forget J' v",
        "warp_mca/robots/machine.py",
        "wanted = -(ahead - behind) / (2.0 * NUDGE)",
        "wanted = -0.0 * (ahead - behind) / (2.0 * NUDGE)",
    ),
    "limit_without_damping": Mutation(
        "limits of a machine have no damper",
        "warp_mca/robots/machine.py",
        "2.0 * inertia * LIMIT_RATE",
        "0.0 * inertia * LIMIT_RATE",
    ),
    "quaternion_turns_in_the_world": Mutation(
        "quaternions of a machine take angular velocities as those in the world",
        "warp_mca/robots/machine.py",
        "w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a",
        "w * a - y * c + z * b, w * b - z * a + x * c, w * c - x * b + y * a",
    ),
    "touch_at_the_end_of_the_step": Mutation(
        "a machine touches at the end of the step in which a gap closes",
        "warp_mca/robots/swing.py",
        "self.times.append(solver.t if touch is None else touch[0])",
        "self.times.append(solver.t)",
    ),
    "drives_let_go": Mutation(
        "drives of a machine do not act during an impact",
        "warp_mca/robots/drives.py",
        "if machine.passive or not drives:",
        "if True or not drives:",
    ),
}
