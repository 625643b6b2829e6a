"""Owns the model that rates are measured on: two bricks, one on the other, and the states that they are held in.

One model has everything: plasticity, contact with friction, a hinge, a driven face. Cases leave out what they go
without, so that a mesh is assembled once. Its state is prescribed, not computed: turned by 0.2 rad and stretched along
x, beyond yield in the wanted share of its length. The time step is 1e-6 of the stable one, so that forces change no
velocity worth naming, and velocities let the strain grow by 1e-6 of itself each step: what yields goes on yielding.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from unittest.mock import patch

import numpy as np
import warp as wp
from numpy.typing import NDArray

import warp_mca as mca
from warp_mca.geometry.cell_types import TETRAHEDRON, linear_type
from warp_mca.model.build import build_model
from warp_mca.model.stable_step import Elements, stable_step
from warp_mca.physics.elements import ELEMENTS
from warp_mca.step.solver import Solver
from warp_mca.system.model import Model
from warp_mca.system.time_step import StableStep

STEEL = mca.J2Bilinear(E=210e9, nu=0.3, rho=7850.0, sigma_y=400e6, E_t=2e9)
SIZES = {"5k": 5_000, "50k": 50_000, "159k": 159_000, "1M": 1_000_000, "4M": 4_000_000, "16M": 16_000_000}
CELL = 1e-3  # edge of a cell [m]
TURN = 0.2  # of both bricks about the hinge [rad]
GROWTH = 1e-6  # of the strain in a step, as a share of it
STEP = 1e-6  # time step as a share of the stable one
DISTORTION = 0.12  # of inner nodes, as a share of a cell


@dataclass(frozen=True)
class Case:
    """What a timed model has: `yielding` is the share beyond yield or None where elastic, `record` steps a record."""

    yielding: float | None = None
    contact: bool = False
    mu: float = 0.0
    joint: bool = False
    driven: bool = False
    record: int = 0


RATES = {
    "elastic": Case(),
    "plastic, none yields": Case(0.0),
    "plastic, 5 % yield": Case(0.05),
    "plastic, all yield": Case(1.0),
    "elastic, contact": Case(contact=True, mu=0.3),
    "elastic, hinge": Case(joint=True),
    "elastic, record each 10 steps": Case(record=10),
    "elastic, record each 100 steps": Case(record=100),
}
FULL = Case(0.05, contact=True, mu=0.3, joint=True, driven=True, record=10)
SAVINGS = {
    "plasticity": replace(FULL, yielding=None),
    "friction": replace(FULL, mu=0.0),
    "contact": replace(FULL, contact=False),
    "hinge": replace(FULL, joint=False),
    "driven face": replace(FULL, driven=False),
    "records": replace(FULL, record=0),
}


def _brick(n: int, y: float, shift: float) -> mca.Mesh:
    """2 n x n x n cells with inner nodes moved at random."""
    size = tuple(CELL * k for k in (2 * n, n, n))
    made = mca.Box(size=size, divisions=(2 * n, n, n), origin=(shift, y, shift)).build()
    inner = np.ones(len(made.points), dtype=bool)
    for nodes in made.node_sets.values():
        inner[nodes] = False
    move = np.random.default_rng(1).uniform(-DISTORTION, DISTORTION, (len(inner), 3)) * CELL
    return mca.Mesh(made.points + move * inner[:, None], made.hexahedra, made.node_sets, made.cell_sets)


def assemble(element: str, count: int) -> Model:
    """The model with everything, of about `count` elements."""
    n = max(2, round((count / (24 if linear_type(ELEMENTS[element].cell) is TETRAHEDRON else 4)) ** (1 / 3)))
    # the upper brick stands aside by a third of a cell, so that no node meets another
    geometry = {"lower": _brick(n, 0.0, 0.0), "upper": _brick(n, n * CELL, CELL / 3)}
    scene = mca.Scene(
        name="blocks",
        bodies=tuple(mca.Body(name=k, geometry=g, material=STEEL, element=element) for k, g in geometry.items()),
        contacts=(
            mca.Contact(slave=mca.Surface(body="upper", nodes="ymin"), master=mca.Surface(body="lower", nodes="ymax")),
        ),
        joints=(mca.Revolute(name="O", body="lower", at=(0.0, 0.0, 0.0)),),
        prescribed=(mca.Prescribed(body="upper", nodes="xmax", axis="x", times=(0.0,), velocities=(0.0,)),),
        impact=mca.ImpactPhase(duration=1e-3),
    )
    meshes = mca.mesh(scene)
    rest = {name: np.zeros_like(m.points) for name, m in meshes.items()}
    with patch("warp_mca.model.assembly.stable_step", _stable_step):
        return build_model(scene, meshes, {name: m.points for name, m in meshes.items()}, rest)


def _stable_step(elements: Elements) -> StableStep:
    """That of the first elements: all are alike, and eigenvalues of millions would take minutes."""
    of_each = ("conn", "K", "G", "mass", "contact", "index")
    return stable_step(replace(elements, **{name: getattr(elements, name)[:20_000] for name in of_each}))


def without(model: Model, case: Case) -> Model:
    """The model with what the case has."""
    law = STEEL.law if case.yielding is not None else mca.Elastic.law
    blocks = tuple(replace(block, law=law) for block in model.blocks)
    changes: dict[str, object] = {"blocks": blocks}
    changes["passes"] = tuple(replace(p, mu=case.mu) for p in model.passes) if case.contact else ()
    if not case.joint:
        pairs = "joint_first", "joint_second", "joint_tied", "joint_slides", "joints"
        changes |= {name: getattr(model, name)[:0] for name in pairs}
    if case.driven:
        _, v = motion(model, case)
        changes["table_value"] = v[model.prescribed_node[:1], 0]
    else:
        changes |= {key: getattr(model, key)[:0] for key in ("prescribed_node", "prescribed_axis", "prescribed_table")}
        changes |= {"table_offset": np.zeros(1, np.int32), "table_time": np.zeros(0), "table_value": np.zeros(0)}
    return replace(model, **changes)


def motion(model: Model, case: Case) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Displacements [m] and velocities [m/s] of the case's state, shape (node_count, 3)."""
    x = model.X[:, 0]
    beyond = case.yielding or 0.0
    yield_strain = STEEL.sigma_y / (2.0 * STEEL.shear_modulus)  # of a stretch whose sides are held
    edge = (1.0 - beyond) * x.max() if beyond < 1.0 else x.min()
    stretch = np.zeros_like(model.X)
    stretch[:, 0] = yield_strain * (0.5 * np.minimum(x, edge) + 1.5 * np.maximum(x - edge, 0.0))
    upper = np.arange(len(x)) >= model.node_start["upper"]
    stretch[upper, 1] -= 1e-3 * CELL  # presses on the lower brick
    c, s = np.cos(TURN), np.sin(TURN)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    u = (model.X + stretch) @ turn.T - model.X
    grow = stretch * [1.0, 0.0, 0.0]
    return u, GROWTH / (STEP * model.stable.dt) * grow @ turn.T


class Held:
    """A solver of the model as the case has it, with a motion to return to.

    Attributes:
        solver: of warp_mca.
        state: that it advances.
        case: what it has.
        precision: as in `warp_mca.run`.
    """

    def __init__(self, model: Model, case: Case, device: str, precision: str) -> None:
        part = without(model, case)
        self.case, self.device, self.precision = case, device, precision
        self.solver = Solver(part, device=device, precision=precision, dt=STEP * model.stable.dt)
        u, v = motion(model, case)
        with wp.ScopedDevice(device):
            self._u, self._v = wp.array(u, dtype=wp.vec3d), wp.array(v, dtype=wp.vec3d)
        self.solver.compile()
        self.renew()

    def renew(self) -> None:
        """Take a new state, for which graphs are captured anew."""
        self.state = self.solver.new_state()
        self.reset()
        self.solver.begin(self.state)

    def reset(self) -> None:
        """Back to the motion, without plastic strain and friction."""
        with wp.ScopedDevice(self.device):
            wp.copy(self.state.u, self._u)
            wp.copy(self.state.v, self._v)
            for own in self.state.elements:
                own.yielded.zero_()
                own.history.zero_()
            for touched in self.state.contacts:
                touched.spring.tangential.zero_()
            self.solver.work.nodal_force.zero_()

    def advance(self, steps: int) -> None:
        """Launch `steps` steps: a multiple of the case's records, or up to one."""
        if self.case.record:
            self.solver.record_and_step(self.state, steps)
        else:
            self.solver.step(self.state, steps)

    def yielded(self) -> float:
        """Share of elements that have yielded [-]."""
        if self.case.yielding is None:
            return 0.0
        return float(np.mean(np.concatenate([own.yielded.numpy() for own in self.state.elements])))

    def sound(self) -> bool:
        """Whether no flag is up (search out of date, contact too deep, lists full) and the state is finite."""
        return not self.state.flag.numpy().any() and bool(np.isfinite(self.state.u.numpy()).all())

    def forces(self) -> NDArray[np.float64]:
        """Forces of the elements on each node at the state [N], shape (node_count, 3)."""
        self.reset()
        self.solver.step(self.state, 1)
        # slots of patches are other ones in each precision
        node = np.concatenate([stage.slot_node for stage in self.solver.elements])
        slots = self.solver.work.force.numpy().astype(np.float64)
        count = self.solver.model.node_count
        return np.stack([np.bincount(node, slots[:, k], minlength=count) for k in range(3)], axis=1)
