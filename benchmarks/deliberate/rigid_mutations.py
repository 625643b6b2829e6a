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
    "joint_forgets_second": Mutation(
        "joints between whole bodies act on the second one at its mass centre",
        "kernels/nodes/rigid_joints.py",
        "        step_out.lever[r, 1] = wp.quat_rotate_inv(poses.rotation[b], wp.cross(other, n) + t)",
        "        step_out.lever[r, 1] = wp.quat_rotate_inv(poses.rotation[b], t)",
    ),
    "freedom_not_carried": Mutation(
        "the first freedom of a joint does not carry the second",
        "kernels/nodes/rigid_joints.py",
        "            tail = then(freedom_pose(e, joints, state, step_out), tail)",
        "            tail = then(tail, tail)",
    ),
    "freedoms_in_reverse": Mutation(
        "the second freedom of a joint carries the first",
        "kernels/nodes/rigid_joints.py",
        "            found = then(found, freedom_pose(e, joints, state, step))",
        "            found = then(freedom_pose(e, joints, state, step), found)",
    ),
    "rotor_halved": Mutation(
        "rotors in joints have half of their inertia",
        "kernels/nodes/joint_drives.py",
        "            A = joints.drive[e, wp.static(ARMATURE)]",
        "            A = wp.float64(0.5) * joints.drive[e, wp.static(ARMATURE)]",
    ),
    "cluster_moment_lost": Mutation(
        "joints give the face of a flexible body no moment",
        "kernels/nodes/rigid_joints.py",
        "        step_out.twist[r] = -t\n",
        "        step_out.twist[r] = wp.float64(0.0) * t\n",
    ),
    "gear_pulls_half": Mutation(
        "couplers give the freedom that leads half of its reaction",
        "kernels/nodes/couplers.py",
        "    return -rows.ratio[r]\n",
        "    return wp.float64(-0.5) * rows.ratio[r]\n",
    ),
}
