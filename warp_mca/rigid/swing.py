"""Owns the rigid phase: reads the chain off a scene and swings it until the gap to its target closes."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from warp_mca.base.errors import bad_value
from warp_mca.base.rotation import turn
from warp_mca.geometry.mesh import Mesh
from warp_mca.rigid.chain import Array, Chain, Link, Vec2, mesh_link, slender_link
from warp_mca.scene import Revolute, Scene, Tip, Vec3

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

Gap = Callable[[float, Array], float]

MOST_TURN = 1e4  # of a chain at its own pace [rad]: some minutes of computing
MAX_TURN_PER_STEP = 0.05  # of the chain's own time scale, so that the gap has at most one minimum in a step
SAMPLE_COUNT = 257  # of the trajectory kept for plotting


@dataclass(frozen=True)
class _Event:
    """What solve_ivp watches: a sign change of `value` in one direction, at which it may stop."""

    value: Callable[[float, Array], float]
    terminal: bool
    direction: float

    def __call__(self, t: float, y: Array) -> float:
        return self.value(t, y)


@dataclass(frozen=True, kw_only=True)
class Swing:
    """How the chain came to the target.

    Attributes:
        t_contact: time at which the gap closes [s].
        theta: angles then [rad], shape (link_count,), float64.
        theta_dot: angular velocities then [rad/s], shape (link_count,), float64.
        energy_drift: largest |E - E(0)| over the largest kinetic energy [-].
        t: times of the sampled trajectory, from 0 to t_contact [s], shape (sample_count,), float64.
        theta_t: angles at those times [rad], shape (sample_count, link_count), float64.
        theta_dot_t: angular velocities at those times [rad/s], shape (sample_count, link_count), float64.
    """

    t_contact: float
    theta: Array
    theta_dot: Array
    energy_drift: float
    t: Array
    theta_t: Array
    theta_dot_t: Array


def swing(chain: Chain, theta0: ArrayLike, theta_dot0: ArrayLike, gap: Gap, t_max: float) -> Swing:
    """Integrate the chain from rest or motion until the gap to the target closes.

    DOP853 (Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.5) at relative tolerance 1e-12 with
    the event found on its dense output. Minima of the gap are events too, so a touch that begins and ends within one
    step is found, and a tip that never arrives can be told how near it came.

    Args:
        chain: the links.
        theta0: initial angles [rad], shape (link_count,).
        theta_dot0: initial angular velocities [rad/s], shape (link_count,).
        gap: distance of the tip from the target [m] as a function of time [s] and angles.
        t_max: give up then [s].

    Raises:
        RequestError: the tip overlaps the target at the start, or does not reach it by t_max.
    """
    count = len(chain.links)
    start = np.concatenate([np.asarray(theta0, dtype=np.float64), np.asarray(theta_dot0, dtype=np.float64)])
    if start.shape != (2 * count,) or not np.isfinite(start).all():
        raise bad_value("RigidPhase.theta", theta0, f"give a finite angle and rate for each of {count} links")
    from scipy.integrate import solve_ivp  # whose import takes a tenth of a second

    def flow(_t: float, y: Array) -> Array:
        return np.concatenate([y[count:], chain.acceleration(y[:count], y[count:])])

    def distance(t: float, y: Array) -> float:
        return gap(t, y[:count])

    def approach(t: float, y: Array) -> float:  # 2 us times the rate of the gap along the flow
        step = 1e-6
        return gap(t + step, y[:count] + step * y[count:]) - gap(t - step, y[:count] - step * y[count:])

    reach = sum(math.hypot(*link.hinge_out, *link.centre, math.sqrt(link.inertia / link.mass)) for link in chain.links)
    touching = _check_start(distance(0.0, start), approach(0.0, start), reach)
    with np.errstate(over="ignore"):
        pace = math.sqrt(math.hypot(*chain.gravity) / reach + (start[count:] ** 2).max())
    if not pace * t_max < MOST_TURN:
        remedy = f"links that turn at {pace:.3g} rad/s would turn by more than {MOST_TURN:g} rad; give a shorter time"
        raise bad_value("RigidPhase.t_max", t_max, remedy)
    run = solve_ivp(
        flow,
        (0.0, t_max),
        start,
        method="DOP853",
        rtol=1e-12,
        atol=1e-14,
        max_step=min(t_max, MAX_TURN_PER_STEP / pace) if pace > 0.0 else t_max,
        events=(_Event(distance, terminal=True, direction=-1.0), _Event(approach, terminal=False, direction=1.0)),
        dense_output=True,
    )
    t_contact = 0.0 if touching else _touch(run, distance, t_max)
    return _record(chain, run, t_contact)


def _check_start(gap: float, approach: float, reach: float) -> bool:
    """Whether the tip touches and closes at t = 0 already; an overlap beyond round-off is refused."""
    round_off = 1e-13 * reach
    if gap < -round_off:
        remedy = (
            f"the tip overlaps the target at the start by {-gap:.6g} m; move the target away or change RigidPhase.theta"
        )
        raise bad_value("gap to RigidPhase.target at t = 0 [m]", float(gap), remedy)
    return gap <= round_off and approach < 0.0


def _touch(run: OptimizeResult, distance: Callable[[float, Array], float], t_max: float) -> float:
    """First time at which the gap closes [s]: the terminal event, or an earlier dip within one step."""
    from scipy.optimize import brentq

    closes = [float(t) for t in run.t_events[0]]
    nearest = [(distance(t, run.sol(t)), float(t)) for t in (*run.t_events[1], run.t[-1])]
    for gap, t in nearest[:-1]:
        if gap <= 0.0:
            before = run.t[np.searchsorted(run.t, t) - 1]
            closes.append(float(brentq(lambda s: distance(s, run.sol(s)), before, t, xtol=1e-15)))  # pyright: ignore
    if closes:
        return min(closes)
    if not run.success:
        raise bad_value(
            "RigidPhase.theta_dot", tuple(run.y[len(run.y) // 2 :, 0]), f"the swing broke off: {run.message}"
        )
    gap, t = min([(distance(0.0, run.y[:, 0]), 0.0), *nearest])
    later = "; it was still closing, so a later RigidPhase.t_max may do" if t == run.t[-1] else ""
    raise bad_value(
        "closest gap to RigidPhase.target [m]",
        float(gap),
        f"the tip never reaches the target by t_max = {t_max:g} s and was closest at t = {t:.6g} s; bring target and "
        f"ground hinge nearer by more than that (lower H), or start higher or faster{later}",
    )


def _record(chain: Chain, run: OptimizeResult, t_contact: float) -> Swing:
    """The swing up to t_contact, with its energy checked at the integrator's own steps."""
    count = len(chain.links)
    steps = np.append(run.t[run.t < t_contact], t_contact)
    states = run.sol(steps).T
    kinetic = np.array([chain.kinetic_energy(y[:count], y[count:]) for y in states])
    total = kinetic + np.array([chain.potential_energy(y[:count]) for y in states])
    scale = kinetic.max()
    t = np.linspace(0.0, t_contact, SAMPLE_COUNT if t_contact > 0.0 else 1)
    samples = run.sol(t).T
    return Swing(
        t_contact=t_contact,
        theta=states[-1, :count],
        theta_dot=states[-1, count:],
        energy_drift=float(np.abs(total - total[0]).max() / scale) if scale > 0.0 else 0.0,
        t=t,
        theta_t=samples[:, :count],
        theta_dot_t=samples[:, count:],
    )


def chain_from_scene(scene: Scene, meshes: Mapping[str, Mesh], nodal_masses: Mapping[str, Array]) -> Chain:
    """The chain that the scene's revolute joints form, from the ground outwards.

    The frame of each link is its body's frame, shifted to the inbound hinge; z components of hinges play no part, and
    the position and rotation of the first link's body only place the ground hinge. "mesh" links carry the sums of
    their lumped nodal masses. "slender" links are uniform rods from hinge to hinge, the last one from its hinge to the
    apex of the tip, with one mass per length for all: the first link's nodal mass over its length.

    Args:
        scene: with a rigid phase.
        meshes: by body name.
        nodal_masses: lumped masses by body name [kg], each shape (node_count,), float64.

    Raises:
        RequestError: there is no rigid phase, the joints do not form one open chain from one ground hinge, a hinge is
            not parallel to z, the tip is not on the last link, or the angles do not match the links.
    """
    if scene.rigid is None:
        raise bad_value("Scene.rigid", None, "give a RigidPhase")
    if scene.gravity[2] != 0.0:
        raise bad_value("Scene.gravity", scene.gravity, "the chain swings in the xy plane; leave the z component 0")
    spans = _spans(scene)
    tip, names = scene.rigid.tip, [span[0] for span in spans]
    if len(scene.rigid.theta) != len(spans):
        remedy = f"give {len(spans)} angles and rates, one for each link from the ground outwards ({', '.join(names)})"
        raise bad_value("RigidPhase.theta", scene.rigid.theta, remedy)
    if tip.body != names[-1]:
        raise bad_value("RigidPhase.tip.body", tip.body, f"the tip must be on the last link, {names[-1]}")
    links: list[Link] = []
    line_density = 0.0
    for body, hinge_in, hinge_out in spans:
        if scene.rigid.inertia == "mesh":
            hinges = {"hinge_in": hinge_in, "hinge_out": hinge_out or (0.0, 0.0)}
            links.append(mesh_link(body, meshes[body].points, nodal_masses[body], **hinges))
            continue
        end = hinge_out or _apex(tip, hinge_in)
        length = math.hypot(*end)
        if length == 0.0:
            raise bad_value(f"length of link {body} [m]", length, "its two hinges must not coincide")
        line_density = line_density or float(nodal_masses[body].sum()) / length
        links.append(slender_link(body, end, mass=line_density * length, hinge_out=end, hinge_in=hinge_in))
    return Chain(tuple(links), origin=_ground_hinge(scene, *spans[0][:2]), gravity=scene.gravity[:2])


def _apex(tip: Tip, hinge: Vec2) -> Vec2:
    """Point of the tip's sphere farthest from the hinge, in the link's frame [m]."""
    x, y = tip.centre[0] - hinge[0], tip.centre[1] - hinge[1]
    distance = math.hypot(x, y)
    if distance == 0.0:
        raise bad_value("RigidPhase.tip.centre", tip.centre, "a slender link needs its tip away from its hinge")
    return (x * (1.0 + tip.radius / distance), y * (1.0 + tip.radius / distance))


def _ground_hinge(scene: Scene, name: str, hinge: Vec2) -> Vec2:
    """World position of the first hinge [m]: position + R(rotation) hinge, in the plane."""
    body = scene.body(name)
    turned = turn(body.rotation) @ (*hinge, 0.0)
    return (body.position[0] + float(turned[0]), body.position[1] + float(turned[1]))


def _spans(scene: Scene) -> list[tuple[str, Vec2, Vec2 | None]]:
    """Body, inbound hinge in its frame and outbound hinge from there [m] of each link, from the ground outwards."""
    hinges = _hinges(scene)
    grounded = [joint for joint in hinges if joint.other is None]
    if len(grounded) != 1:
        remedy = "a chain hangs from exactly one ground hinge (a Revolute with other=None)"
        raise bad_value("Scene.joints on the ground", [joint.name for joint in grounded], remedy)
    body, hinge = grounded[0].body, grounded[0].at
    left = [joint for joint in hinges if joint.other is not None]
    spans, visited = [], {body}
    while True:
        touching = [joint for joint in left if body in (joint.body, joint.other)]
        if len(touching) > 1:
            remedy = f"the chain branches or closes a loop at body {body}; give each link one outbound hinge"
            raise bad_value("Scene.joints", [joint.name for joint in touching], remedy)
        if not touching:
            break
        out, child, inbound = _cross(touching[0], body)
        if child in visited:
            raise bad_value(f"Revolute {touching[0].name}", child, "the joint closes a loop; the chain must stay open")
        spans.append((body, hinge[:2], (out[0] - hinge[0], out[1] - hinge[1])))
        left.remove(touching[0])
        body, hinge = child, inbound
        visited.add(body)
    if left:
        remedy = f"these joints do not hang on the ground hinge {grounded[0].name}; connect or remove them"
        raise bad_value("Scene.joints", [joint.name for joint in left], remedy)
    return [*spans, (body, hinge[:2], None)]


def _hinges(scene: Scene) -> list[Revolute]:
    """The scene's joints, all hinges about z.

    Raises:
        RequestError: one of them is not.
    """
    hinges = []
    for joint in scene.joints:
        if not isinstance(joint, Revolute):
            remedy = "the links of a rigid phase hang on Revolute joints; leave other kinds out, or the rigid phase"
            raise bad_value("Scene.joints", joint.title, remedy)
        if joint.axis[0] != 0.0 or joint.axis[1] != 0.0 or joint.axis[2] == 0.0:
            raise bad_value(f"Revolute {joint.name}.axis", joint.axis, "a planar chain hinges about z; give (0, 0, 1)")
        hinges.append(joint)
    return hinges


def _cross(joint: Revolute, body: str) -> tuple[Vec3, str, Vec3]:
    """Where the joint lies in `body` [m], the body on its other side, and where it lies there [m]."""
    assert joint.other is not None
    if joint.body == body:
        return joint.at, joint.other, joint.other_at
    return joint.other_at, joint.body, joint.at
