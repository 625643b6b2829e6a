"""Owns the axis of rotation increments: what keeps a rotation in the engine's kernels, after a million revolutions."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import warp as wp

from benchmarks.stability.axis import Direct, Figure, axis
from warp_mca.kernels.elements.rotation import nearest_rotation
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.nodes.coupling import turned
from warp_mca.kernels.nodes.floating import follow_bodies
from warp_mca.kernels.nodes.hinge import quickly_turned
from warp_mca.kernels.nodes.rigid_body import move_on
from warp_mca.kernels.nodes.rigid_motion import Poses, RigidStep

REVOLUTIONS = 1_000_000
AXIS = np.array([2.0, -3.0, 6.0]) / 7.0
COARSE, FINE = 100, 4000  # increments of a revolution, less LESS; those of FINE are so small that pins take series
LESS = 0.5 * (3.0 - math.sqrt(5.0))  # so that no increment ever comes back to where another was
UPDATES, FRAME = 100_000, 1000  # of a floating frame, and those of a revolution
Found = tuple[list[Figure], int]  # figures, and number of increments


@wp.kernel(enable_backward=False)
def turn_body(
    revolutions: int,
    parts: int,
    poses_out: Poses,
    step_out: RigidStep,
):
    """Apply so many equal steps to the pose of a rigid body."""
    for _ in range(revolutions):
        for _ in range(parts):
            move_on(0, wp.float64(0.0), True, poses_out, step_out)


@cache
def turn_pin(quick: bool) -> Any:
    """Kernel: so many equal steps of the orientation of a pin's cluster, by series if `quick`."""
    function = quickly_turned if quick else turned

    @wp.kernel(enable_backward=False, module="unique")
    def steps(revolutions: int, parts: int, angle: wp.vec3d, rotation_out: wp.array(dtype=wp.quatd)):
        q = rotation_out[0]
        for _ in range(revolutions):
            for _ in range(parts):
                q = function(q, angle)
        rotation_out[0] = q

    return steps


@wp.kernel(enable_backward=False)
def place_markers(angle: wp.float64, axis: wp.vec3d, X: wp.array(dtype=wp.vec3d), u_out: wp.array(dtype=wp.vec3d)):
    """Displacements [m] of points that turn about an axis through the origin."""
    i = wp.tid()
    q = wp.quat_from_axis_angle(axis, angle)
    u_out[i] = wp.quat_rotate(q, X[i]) - X[i]


@cache
def rotate_elements(precision: str) -> Any:
    """Kernel: rotation Q - I of elements that have turned by angles [rad] and are stretched along their first axis."""
    t = scalars(precision)
    polar, mat33, real = nearest_rotation(precision), t.mat33, t.real

    @wp.kernel(enable_backward=False, module="unique")
    def steps(angle: wp.array(dtype=wp.float64), axis: wp.vec3d, stretch: wp.float64, W_out: wp.array(dtype=mat33)):
        i = wp.tid()
        Q = wp.quat_to_matrix(wp.quat_from_axis_angle(axis, angle[i]))
        F = mat33()
        for r in range(3):
            F[r, 0] = real(stretch * Q[r, 0])
            F[r, 1] = real(Q[r, 1])
            F[r, 2] = real(Q[r, 2])
        W_out[i] = polar(F)

    return steps


def _rotation(device: str) -> wp.array:
    return wp.array(np.array([[0.0, 0.0, 0.0, 1.0]]), dtype=wp.quatd, device=device)


def _of_quaternion(q: np.ndarray, turned_by: float, angle_allowed: float = 1e-6) -> list[Figure]:
    """What is left of a quaternion beside the one that has turned by so much [rad]."""
    size = float(np.linalg.norm(q))
    half = 0.5 * math.remainder(turned_by, 4.0 * math.pi)
    beyond = math.cos(half) * q[:3] - q[3] * math.sin(half) * AXIS - math.sin(half) * np.cross(q[:3], AXIS)
    angle = 2.0 * math.asin(min(float(np.linalg.norm(beyond)) / size, 1.0))
    return [Figure("angle", angle, 0.0, angle_allowed, 1.0), Figure("length of the quaternion", size, 1.0, 1e-12)]


def rigid_body(precision: str, device: str) -> Found:
    """`move_on`, by Cayley's form of the rotation of a step."""
    angle = 2.0 * math.pi / (COARSE - LESS)
    poses, step = Poses(), RigidStep()
    step.turn = wp.array([AXIS * math.tan(0.5 * angle)], dtype=wp.vec3d, device=device)
    step.velocity, poses.centre = (wp.zeros(1, dtype=wp.vec3d, device=device) for _ in range(2))
    step.turned, poses.rotation = wp.zeros(1, dtype=wp.mat33d, device=device), _rotation(device)
    poses.turn = wp.zeros(1, dtype=wp.float64, device=device)
    wp.launch(turn_body, 1, [REVOLUTIONS, COARSE], [poses, step], device=device)
    return _of_quaternion(poses.rotation.numpy()[0], REVOLUTIONS * COARSE * angle), REVOLUTIONS * COARSE


def _pin(quick: bool) -> Callable[[str, str], Found]:
    def measure(precision: str, device: str) -> Found:
        parts = FINE if quick else COARSE
        rotation, angle = _rotation(device), 2.0 * math.pi / (parts - LESS)
        wp.launch(turn_pin(quick), 1, [REVOLUTIONS, parts, wp.vec3d(*(angle * AXIS))], [rotation], device=device)
        return _of_quaternion(rotation.numpy()[0], REVOLUTIONS * parts * angle), REVOLUTIONS * parts

    return measure


def floating_frame(precision: str, device: str) -> Found:
    """`follow_bodies`: fitted to markers each time, so that nothing adds up; it lags by the square of an increment."""
    corners = np.array([[x, y, z] for x in (0.0, 0.3) for y in (-0.05, 0.05) for z in (-0.05, 0.05)])
    X = wp.array(corners, dtype=wp.vec3d, device=device)
    marker = wp.array(np.arange(len(corners))[None], dtype=wp.int32, device=device)
    u, rotation, about = wp.zeros_like(X), _rotation(device), wp.vec3d(*AXIS)
    for k in range(1, UPDATES + 1):
        angle = 2.0 * math.pi * (k % FRAME) / FRAME
        wp.launch(place_markers, len(corners), [angle, about, X], [u], device=device)
        wp.launch(follow_bodies, 1, [X, marker, u], [rotation], device=device)
    return _of_quaternion(rotation.numpy()[0], 0.0, 1e-5), UPDATES


def elements(precision: str, device: str) -> Found:
    """`nearest_rotation` of the deformation gradient: of the place alone, so that nothing adds up."""
    turned_by = 2.0 * np.pi * np.arange(REVOLUTIONS) / REVOLUTIONS
    angle = wp.array(turned_by, dtype=wp.float64, device=device)
    W = wp.zeros(REVOLUTIONS, dtype=scalars(precision).mat33, device=device)
    wp.launch(rotate_elements(precision), REVOLUTIONS, [angle, wp.vec3d(*AXIS), 1.001], [W], device=device)
    Q = W.numpy().astype(np.float64) + np.eye(3)
    defect = float(np.abs(np.einsum("nij,nik->njk", Q, Q) - np.eye(3)).max())
    K = np.array([[0.0, -AXIS[2], AXIS[1]], [AXIS[2], 0.0, -AXIS[0]], [-AXIS[1], AXIS[0], 0.0]])
    sine, cosine = np.sin(turned_by)[:, None, None], np.cos(turned_by)[:, None, None]
    exact = np.eye(3) + sine * K + (1.0 - cosine) * (K @ K)
    turn = float(np.linalg.norm(Q - exact, axis=(1, 2)).max()) / math.sqrt(2.0)
    least = 1e-6 if precision == "mixed" else 1e-12
    return [Figure("angle", turn, 0.0, least, 1.0), Figure("orthogonality", defect, 0.0, least, 1.0)], REVOLUTIONS


KINDS: dict[str, Callable[[str, str], Found]] = {
    "rigid body": rigid_body,
    "cluster of a pin": _pin(False),
    "cluster of a pin, small increments": _pin(True),
    "floating frame": floating_frame,
    "element": elements,
}


@axis(
    group="rotations",
    title="Increments of a million revolutions",
    reference="The kernels' functions that turn what keeps a rotation, about one axis: rigid bodies and clusters of "
    f"pins by some {COARSE} increments of a revolution ({FINE:,} small ones), floating frames fitted {UPDATES:,} "
    "times, elements at a million angles.",
    values=tuple(KINDS),
    level="long",
    elements=("hex8",),
)
def rotation_increments(value: str, element: str) -> Direct:
    """As `KINDS`."""
    return Direct(KINDS[value], "rad")
