"""A load of the user's own in one file: a torsion spring in a hinge between two bodies, or a body and the ground."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import pytest
import warp as wp
from impacts import finished, result_of
from numpy.typing import NDArray
from outside import goes_on

import warp_mca as mca
from warp_mca.base.joining import AS_IS, joinable
from warp_mca.physics.loads.nodal_stage import NodalLoad
from warp_mca.scene.loads import Load
from warp_mca.system.loads import LoadedNodes

if TYPE_CHECKING:
    from warp_mca.system.actor import System
    from warp_mca.system.bodies import Bodies
    from warp_mca.system.stage import Step
    from warp_mca.system.state import State


@mca.register
@dataclass(frozen=True, kw_only=True)
class TorsionSpring(Load):
    """Torque -k (theta - rest) about z between a body and another one, or the ground.

    theta is the mean rotation of the nodes of both, that of sum m R.x and sum m R x x about their mass centre: the
    torque acts on all of them, as the gradient of its energy, which is therefore conserved.

    Attributes:
        nodes: node set of the body that turns.
        other, other_nodes: body and node set against which it turns; None is the ground.
        stiffness: k [N m/rad].
        rest: angle without torque [rad].
    """

    nodes: str
    other: str | None = None
    other_nodes: str | None = None
    stiffness: float
    rest: float = 0.0

    energies: ClassVar[tuple[str, ...]] = ("spring",)
    refuses: ClassVar[Mapping[str, str]] = {"multi_rate": "its torque is that of one common step; leave it out"}

    def bodies(self) -> dict[str, str]:
        return {"body": self.body} | ({"other": self.other} if self.other else {})

    def sets(self) -> dict[str, tuple[str, str, bool]]:
        other = {"other_nodes": (self.other, self.other_nodes, False)} if self.other and self.other_nodes else {}
        return {"nodes": (self.body, self.nodes, False), **other}

    def build(self, assembly: Bodies, start: float) -> TurnedNodes:
        sides = [assembly.nodes(self.body, self.nodes)]
        sides += [assembly.nodes(self.other, self.other_nodes)] if self.other and self.other_nodes else []
        arms, inertia = [], []
        for nodes in sides:
            X, mass = assembly.X[nodes, :2], assembly.mass[nodes]
            arms.append(X - mass @ X / mass.sum())
            inertia.append(float(mass @ (arms[-1] ** 2).sum(axis=1)))
        return TurnedNodes(
            node=np.concatenate(sides).astype(np.int32),
            arm=np.concatenate(arms),
            weight=np.concatenate([assembly.mass[nodes] for nodes in sides]),
            middle=len(sides[0]),
            added=self.stiffness * sum(1.0 / J for J in inertia),
            stiffness=self.stiffness,
            rest=self.rest,
        )

    @classmethod
    def stage(cls) -> type[TorsionSprings]:
        return TorsionSprings


@joinable
@dataclass(frozen=True, kw_only=True)
class TurnedNodes(LoadedNodes):
    """Nodes of a spring: `middle` of the body, then those of the other one; arms from their mass centres [m]."""

    arm: NDArray[np.float64] = field(metadata=AS_IS)
    weight: NDArray[np.float64] = field(metadata=AS_IS)
    middle: int = field(metadata=AS_IS)
    added: float = field(metadata=AS_IS)
    stiffness: float = field(metadata=AS_IS)
    rest: float = field(metadata=AS_IS)

    def eigenvalues(self, mass: NDArray[np.float64]) -> NDArray[np.float64]:
        """k sum of 1 / J: the eigenvalue of two discs with a spring between them."""
        return np.full(len(self.node), self.added)


@dataclass(eq=False)
class SpringState:
    """Energy of each spring at t(n) [J], shape (count,), float64."""

    energy: wp.array


@wp.func
def turn_of(
    first: int,
    end: int,
    node: wp.array(dtype=wp.int32),
    arm: wp.array(dtype=wp.vec2d),
    weight: wp.array(dtype=wp.float64),
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
):
    """(C, S) = sum of m R.x and of m R x x: arms add up to nothing, so that x needs no centre."""
    found = wp.vec2d()
    for k in range(first, end):
        x = X[node[k]] + u[node[k]]
        R = arm[k]
        found += weight[k] * wp.vec2d(R[0] * x[0] + R[1] * x[1], R[0] * x[1] - R[1] * x[0])
    return found


@wp.func
def twist(
    first: int,
    end: int,
    torque: wp.float64,
    turn: wp.vec2d,
    node: wp.array(dtype=wp.int32),
    arm: wp.array(dtype=wp.vec2d),
    weight: wp.array(dtype=wp.float64),
    force_out: wp.array(dtype=wp.vec3d),
):
    """f = T dtheta/dx with theta = atan2(S, C)."""
    factor = torque / wp.dot(turn, turn)
    C = turn[0]
    S = turn[1]
    for k in range(first, end):
        R = arm[k]
        f = factor * weight[k] * wp.vec2d(-C * R[1] - S * R[0], C * R[0] - S * R[1])
        force_out[node[k]] = force_out[node[k]] + wp.vec3d(f[0], f[1], wp.float64(0.0))


@wp.kernel(enable_backward=False)
def spring_torque(
    middle: int,
    stiffness: wp.float64,
    rest: wp.float64,
    node: wp.array(dtype=wp.int32),
    arm: wp.array(dtype=wp.vec2d),
    weight: wp.array(dtype=wp.float64),
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    nodal_force_out: wp.array(dtype=wp.vec3d),
    energy_out: wp.array(dtype=wp.float64),
):
    """One spring, by one thread: T = -k (theta - rest), V = 1/2 k (theta - rest)^2."""
    end = node.shape[0]
    turn = turn_of(0, middle, node, arm, weight, X, u)
    other = turn_of(middle, end, node, arm, weight, X, u)
    theta = wp.atan2(turn[1], turn[0]) - rest
    if end > middle:
        theta -= wp.atan2(other[1], other[0])
    energy_out[0] = wp.float64(0.5) * stiffness * theta * theta
    twist(0, middle, -stiffness * theta, turn, node, arm, weight, nodal_force_out)
    if end > middle:
        twist(middle, end, stiffness * theta, other, node, arm, weight, nodal_force_out)


class TorsionSprings(NodalLoad):
    """All springs, one after the other."""

    def __init__(self, solver: System, name: str) -> None:
        super().__init__(solver, name)
        self.arrays = [
            [
                wp.array(item.node, dtype=wp.int32),
                wp.array(item.arm, dtype=wp.vec2d),
                wp.array(item.weight, dtype=wp.float64),
            ]
            for item in self.items
        ]

    def entries(self, item: Any) -> int:
        return 1

    def new_state(self) -> SpringState:
        return SpringState(energy=wp.zeros(self.count, dtype=wp.float64))

    def kernels(self) -> list[Any]:
        return [spring_torque]

    def push(self, step: Step, start: bool = False) -> None:
        state, work, energy = step.state, self.work, step.state.parts[self.name].energy
        for k, (item, arrays) in enumerate(zip(self.items, self.arrays, strict=True)):
            inputs = [item.middle, item.stiffness, item.rest, *arrays, work.X, state.u]
            wp.launch(spring_torque, 1, inputs=inputs, outputs=[work.nodal_force, energy[k : k + 1]])

    def energies_of(self, state: State) -> list[wp.array]:
        return [state.parts[self.name].energy]


L, H, K, REST = 0.05, 0.005, 5.0, 0.2
STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7800.0)
MASS = STEEL.rho * L * H * H
J = MASS * (L**2 + H**2) / 12.0
BAR = mca.Box(size=(L, H, H), divisions=(16, 2, 1), origin=(0.0, -0.5 * H, 0.0))
SPRING = TorsionSpring(body="bar", nodes="boundary", stiffness=K, rest=REST)


def swinging(duration: float, **change: Any) -> mca.Scene:
    """A bar on a hinge at its end, which a spring turns from 0 to twice its rest angle and back."""
    scene = mca.Scene(
        name="swinging",
        bodies=(mca.Body(name="bar", geometry=BAR, material=STEEL),),
        joints=(mca.Revolute(name="A", body="bar", at=(0.0, 0.0, 0.0), nodes="axis"),),
        loads=(SPRING,),
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / 200.0, energy_tolerance=1e-4),
    )
    return replace(scene, **change)


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)])
def test_a_quarter_period_is_that_of_the_closed_form_and_energy_is_kept(device: str):
    """pi/2 sqrt(J/k) about the hinge, beside a rigid body; what the spring gives is motion, and the ledger closes."""
    quarter = 0.5 * math.pi * math.sqrt((J + 0.25 * MASS * L**2) / K)
    bodies = swinging(quarter).bodies
    rigid = replace(bodies[0], name="rigid", position=(0.0, 0.1, 0.0), rigid=True)
    result = result_of(finished(swinging(1.1 * quarter, bodies=(*bodies, rigid)), precision="float64", device=device))
    energy, initial = result["E_spring"], 0.5 * K * REST**2
    assert energy[0] == pytest.approx(initial, rel=1e-12)
    least = int(energy.argmin())
    assert energy[least] < 1e-3 * initial and result["E_kinetic"][least] == pytest.approx(initial, rel=2e-3)
    deflection = np.sqrt(energy)
    near = slice(least - 6, least + 7)
    signed = np.where(np.arange(len(energy)) < least, deflection, -deflection)[near]
    signed[6] = np.nan  # on either side
    use = np.isfinite(signed)
    slope, offset = np.polyfit(result["time_s"][near][use], signed[use], 1)
    assert -offset / slope == pytest.approx(quarter, rel=5e-3)
    assert result.summary["energy"]["external_work"] == 0.0
    assert abs(result.summary["energy"]["error"]) < 1e-4 * initial


def test_a_spring_between_two_bodies_gives_no_momentum_and_no_spin():
    (first,) = swinging(1e-4).bodies
    second = replace(first, name="b", position=(0.0, 0.1, 0.0))
    spring = replace(SPRING, other="b", other_nodes="boundary")
    impact = finished(swinging(1e-4, bodies=(first, second), joints=(), loads=(spring,)), precision="float64")
    model, v = impact.solver.model, impact.state.v.numpy()
    x = model.X + impact.state.u.numpy() - 0.5 * impact.solver.dt * v  # at the half step
    assert np.abs(v).max() > 0.1
    assert model.mass @ v == pytest.approx(0.0, abs=1e-15)
    assert model.mass @ np.cross(x, v) == pytest.approx(0.0, abs=1e-12)


def test_a_model_file_and_a_checkpoint_go_on_to_the_same_bits(tmp_path: Path):
    goes_on(swinging(1e-4), tmp_path)


def test_a_batch_gives_the_figures_of_the_scenes_alone():
    scenes = [swinging(1e-4), swinging(1e-4, loads=(replace(SPRING, stiffness=2.0 * K),))]
    for result, scene in zip(mca.run_batch(scenes), scenes, strict=True):
        alone = mca.run(scene)
        for name in ("E_kinetic", "E_spring"):
            assert result[name] == pytest.approx(alone[name], rel=1e-9)


def test_several_rates_are_refused_by_name():
    with pytest.raises(mca.RequestError, match=r"Scene.loads = .TorsionSpring.: it does not go with multi_rate; its"):
        mca.run(swinging(1e-4), multi_rate=2)
