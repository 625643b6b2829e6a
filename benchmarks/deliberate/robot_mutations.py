"""Owns the deliberate errors in machines from robot files."""

from __future__ import annotations

from benchmarks.deliberate.mutation import Mutation

ROBOT_MUTATIONS: dict[str, Mutation] = {
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
        "self.times.append(stepper.t if touch is None else touch[0])",
        "self.times.append(stepper.t)",
    ),
    "drives_let_go": Mutation(
        "drives of a machine do not act during an impact",
        "warp_mca/robots/drives.py",
        'if "ACTUATION" in machine.off or not drives:',
        "if True:",
    ),
}
