"""A load of the user's own in one file: a pressure p(t) on a named surface, which follows the surface as it deforms."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import warp as wp
from impacts import begun, finished, momentum, result_of
from numpy.typing import NDArray
from outside import goes_on

import warp_mca as mca
from warp_mca.base.joining import AS_IS, joinable, of
from warp_mca.physics.loads.nodal import LoadedNodes
from warp_mca.physics.loads.nodal_stage import NodalLoad
from warp_mca.scene.loads import Load
from warp_mca.step.stage import Step

if TYPE_CHECKING:
    from warp_mca.model.assembly import Assembly
    from warp_mca.step.solver import Solver
    from warp_mca.step.state import State


@mca.register
@dataclass(frozen=True, kw_only=True)
class Pressure(Load):
    """Pressure on a surface by a table, linear between its times.

    Attributes:
        nodes: node set of the body's mesh; faces all of whose corners belong to it are pressed.
        times: [s].
        pressures: then [Pa].
    """

    nodes: str
    times: tuple[float, ...]
    pressures: tuple[float, ...]

    def sets(self) -> dict[str, tuple[str, str, bool]]:
        return {"nodes": (self.body, self.nodes, True)}

    def build(self, assembly: Assembly, start: float) -> PressedNodes:
        face, _ = assembly.meshes[self.body].surface(self.nodes)
        face = (face + assembly.node_start[self.body]).astype(np.int32)
        node = np.unique(face).astype(np.int32)
        corner = np.argsort(face.ravel(), kind="stable").astype(np.int32)
        first = np.searchsorted(face.ravel()[corner], [*node, node[-1] + 1]).astype(np.int32)
        times = np.array(self.times) - start
        values = np.array(self.pressures)
        return PressedNodes(node=node, face=face, corner=corner, first=first, times=times, pressures=values)

    @classmethod
    def stage(cls) -> type[PressureStage]:
        return PressureStage


@joinable
@dataclass(frozen=True, kw_only=True)
class PressedNodes(LoadedNodes):
    """Nodes of one pressure; `corner` lists places in `face` of each node, which begin at `first`."""

    face: NDArray[np.int32] = field(metadata=of("nodes"))
    corner: NDArray[np.int32] = field(metadata=AS_IS)
    first: NDArray[np.int32] = field(metadata=AS_IS)
    times: NDArray[np.float64] = field(metadata=AS_IS)
    pressures: NDArray[np.float64] = field(metadata=AS_IS)


@dataclass(eq=False)
class PressureState:
    """Force on each node at t(n) [N], its work up to then [J] and steps that it has taken [-], shape (node_count,)."""

    force: wp.array
    work: wp.array
    clock: wp.array


@wp.func
def mean_value(times: wp.array(dtype=wp.float64), values: wp.array(dtype=wp.float64), a: wp.float64, b: wp.float64):
    """Mean of a table from time a to b, linear between its entries and constant beyond them."""
    n = times.shape[0]
    total = wp.float64(0.0)
    for k in range(n + 1):
        lower = a
        upper = b
        if k > 0:
            lower = wp.max(a, times[k - 1])
        if k < n:
            upper = wp.min(b, times[k])
        if upper > lower:
            value = values[wp.min(k, n - 1)]
            if k > 0 and k < n:
                before = (wp.float64(0.5) * (lower + upper) - times[k - 1]) / (times[k] - times[k - 1])
                value = values[k - 1] + (values[k] - values[k - 1]) * before
            total += value * (upper - lower)
    return total / (b - a)


@wp.func
def share(corner: int, a: wp.vec3d, b: wp.vec3d, c: wp.vec3d, d: wp.vec3d):
    """Integral of N n over a bilinear face for one of its corners [m^2], by 2 x 2 points, which are exact for it."""
    total = wp.vec3d()
    for j in range(4):
        xi = wp.float64(wp.static(3.0**-0.5)) * wp.float64(2 * (j % 2) - 1)
        eta = wp.float64(wp.static(3.0**-0.5)) * wp.float64(2 * (j // 2) - 1)
        one = wp.float64(1.0)
        along = wp.float64(0.25) * ((one - eta) * (b - a) + (one + eta) * (c - d))
        across = wp.float64(0.25) * ((one - xi) * (d - a) + (one + xi) * (c - b))
        x_sign = wp.float64(-1.0)
        y_sign = wp.float64(-1.0)
        if corner == 1 or corner == 2:
            x_sign = one
        if corner > 1:
            y_sign = one
        total += wp.float64(0.25) * (one + x_sign * xi) * (one + y_sign * eta) * wp.cross(along, across)
    return total


@wp.kernel(enable_backward=False)
def press(
    node: wp.array(dtype=wp.int32),
    face: wp.array(dtype=wp.vec4i),
    corner: wp.array(dtype=wp.int32),
    first: wp.array(dtype=wp.int32),
    times: wp.array(dtype=wp.float64),
    pressures: wp.array(dtype=wp.float64),
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    v: wp.array(dtype=wp.vec3d),
    dt: wp.float64,
    start: bool,
    nodal_force_out: wp.array(dtype=wp.vec3d),
    force_out: wp.array(dtype=wp.vec3d),
    work_out: wp.array(dtype=wp.float64),
    clock_out: wp.array(dtype=wp.int32),
):
    """f_i = -p integral of N_i n, with the mean p of the step, so that the kicks add up to the integral of p.

    The work between two steps is that of the mean of both forces: 1/2 (f(n-1) + f(n)) . dt v(n-1/2).
    """
    k = wp.tid()
    i = node[k]
    area = wp.vec3d()
    for j in range(first[k], first[k + 1]):
        q = face[corner[j] // 4]
        area += share(corner[j] % 4, X[q[0]] + u[q[0]], X[q[1]] + u[q[1]], X[q[2]] + u[q[2]], X[q[3]] + u[q[3]])
    t = dt * wp.float64(clock_out[k])
    half = wp.float64(0.5) * dt
    force = -mean_value(times, pressures, t - half, t + half) * area
    if start:  # the half step before
        force = -mean_value(times, pressures, -half, wp.float64(0.0)) * area
    nodal_force_out[i] = nodal_force_out[i] + force
    if not start:
        if clock_out[k] > 0:
            work_out[k] = work_out[k] + half * wp.dot(force_out[k] + force, v[i])
        force_out[k] = force
        clock_out[k] = clock_out[k] + 1


class PressureStage(NodalLoad):
    """All pressures: a launch for each, so that nodes at a common edge take one after the other."""

    def __init__(self, solver: Solver, name: str) -> None:
        super().__init__(solver, name)
        names = ("node", "corner", "first")
        ints = [[wp.array(getattr(item, name), dtype=wp.int32) for name in names] for item in self.items]
        self.arrays = [
            [node, wp.array(item.face, dtype=wp.vec4i), corner, first]
            + [wp.array(values, dtype=wp.float64) for values in (item.times, item.pressures)]
            for item, (node, corner, first) in zip(self.items, ints, strict=True)
        ]

        ends = np.cumsum([len(item.node) for item in self.items])
        self.slices = [slice(end - len(item.node), end) for end, item in zip(ends.tolist(), self.items, strict=True)]

    def new_state(self) -> PressureState:
        return PressureState(
            force=wp.zeros(self.count, dtype=wp.vec3d),
            work=wp.zeros(self.count, dtype=wp.float64),
            clock=wp.zeros(self.count, dtype=wp.int32),
        )

    def kernels(self) -> list[Any]:
        return [press]

    def push(self, step: Step, start: bool = False) -> None:
        state, work, own = step.state, self.work, step.state.parts[self.name]
        for arrays, part in zip(self.arrays, self.slices, strict=True):
            inputs = [*arrays, work.X, state.u, state.v, self.solver.common_dt, start]
            outputs = [work.nodal_force, own.force[part], own.work[part], own.clock[part]]
            wp.launch(press, part.stop - part.start, inputs=inputs, outputs=outputs)

    def energies_of(self, state: State) -> list[wp.array]:
        return [state.parts[self.name].work]


SIZE, PEAK, END = (0.02, 0.01, 0.01), 1e5, 2e-5  # strains of 1e-7, by which the surface grows
AREA = SIZE[1] * SIZE[2]
STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7800.0)
BLOCK = mca.Body(name="block", geometry=mca.Box(size=SIZE, divisions=(8, 4, 4)), material=STEEL)
PUSH = Pressure(body="block", nodes="xmin", times=(0.0, 0.4 * END, END), pressures=(0.0, PEAK, 0.0))


def pushed(**change: Any) -> mca.Scene:
    phase = mca.ImpactPhase(duration=4e-5, output_interval=1e-6, energy_tolerance=1e-4)
    return replace(mca.Scene(name="pushed", bodies=(BLOCK,), loads=(PUSH,), impact=phase), **change)


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)])
def test_a_block_takes_the_impulse_of_the_pressure_and_the_ledger_its_work(device: str):
    """Area times the integral of p, beside a rigid body too; what the block gained is the work that the ledger has."""
    rigid = mca.Body(name="rigid", geometry=BLOCK.geometry, material=STEEL, position=(0.0, 0.1, 0.0), rigid=True)
    impact = finished(pushed(bodies=(BLOCK, rigid)), precision="float64", device=device)
    result, impulse = result_of(impact), 0.5 * PEAK * END * AREA
    gained = momentum(impact, 0, impact.solver.model.node_start["rigid"])
    assert gained == pytest.approx([impulse, 0.0, 0.0], rel=1e-6, abs=1e-12)
    energy = result.summary["energy"]
    mass = STEEL.rho * SIZE[0] * AREA
    assert energy["external_work"] > 0.5 * impulse**2 / mass
    assert abs(energy["error"]) < 1e-4 * energy["external_work"]


def test_the_pressure_follows_the_surface():
    """On a turned face it points along the turned normal, and on a stretched one it grows with the area."""
    impact = begun(pushed(loads=(replace(PUSH, times=(0.0,), pressures=(PEAK,)),)), precision="float64")
    solver, state = impact.solver, impact.state
    turn, stretch = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.diag([1.0, 1.3, 1.0])
    state.u.assign(solver.model.X @ (turn @ stretch - np.eye(3)).T)
    solver.work.nodal_force.zero_()
    solver.Pressure.push(Step(state))
    total = solver.work.nodal_force.numpy().sum(axis=0)
    assert total == pytest.approx(turn @ [1.3 * AREA * PEAK, 0.0, 0.0], rel=1e-12, abs=1e-9)


def test_a_model_file_and_a_checkpoint_go_on_to_the_same_bits(tmp_path: Path):
    goes_on(pushed(), tmp_path)


def test_several_rates_give_the_same_impulse():
    """Pressed nodes take the common steps of contacts and joints, half as long as those of the coarser body."""
    wide = replace(BLOCK.geometry, divisions=(2, 1, 1))
    coarse = replace(BLOCK, name="coarse", geometry=wide, position=(0.0, 0.1, 0.0))
    impact = finished(pushed(bodies=(BLOCK, coarse)), precision="float64", multi_rate=2)
    model = impact.solver.model
    assert model.rates is not None and model.rates.top == 1
    gained = momentum(impact, 0, model.node_start["coarse"])
    assert gained == pytest.approx([0.5 * PEAK * END * AREA, 0.0, 0.0], rel=1e-6, abs=1e-12)
    energy = result_of(impact).summary["energy"]
    assert abs(energy["error"]) < 1e-4 * energy["external_work"]


def test_a_batch_gives_the_figures_of_the_scenes_alone():
    """One of them has an absorbing side besides, whose columns stand behind those of the pressures."""
    side = mca.Absorbing(body="block", nodes="xmax")
    scenes = [pushed(absorbing=(side,)), pushed(loads=(PUSH, replace(PUSH, nodes="ymax")))]
    for result, scene in zip(mca.run_batch(scenes), scenes, strict=True):
        alone = mca.run(scene)
        works = [found.summary["energy"]["external_work"] for found in (result, alone)]
        assert works[0] == pytest.approx(works[1], rel=1e-9) and works[1] > 0.0
        for name in ("E_kinetic", "E_internal"):
            assert result[name] == pytest.approx(alone[name], rel=1e-9)


def test_what_it_does_not_go_with_is_refused_by_name():
    with pytest.raises(mca.RequestError, match=r"Scene.loads = .Pressure.: scenes of a batch have loads of the same"):
        mca.run_batch([pushed(), pushed(loads=())])
    rigid = replace(BLOCK, rigid=True)
    with pytest.raises(mca.RequestError, match=r"Pressure.body = .block.: loads act on nodes of flexible bodies"):
        mca.run(pushed(bodies=(rigid, replace(BLOCK, name="other"))))
    with pytest.raises(mca.RequestError, match=r"Pressure.body = .ball.: the scene's bodies are block"):
        pushed(loads=(replace(PUSH, body="ball"),))
