"""Owns one time step: device arrays and the ordered stages that advance them.

| stage | kernel | runs |
|---|---|---|
| 1 element forces | `hex8_patch_force`, `tet4_force`, … | every step, for each block of like elements |
| 2 contact | `touch_surface` + `react`, or `touch_plane` | every step, in scenes with contact |
| 3 record at t(n) | `hex8_energy`, …, sums | first step of each output interval, checks between: `steps.py` |
| 3a paths, frames at t(n) | `hex8_stress`, …, `nodal_stress` | each output interval, if paths or a frame need it |
| 4 gather and integrate | `integrate` | every step |
| 4a joints, prescribed motion | `advance_bound`, `slide` | every step, beside 4, in scenes with joints or driven axes |
| 5 record of motion | `record_motion` | as 3 |

Broad-phase search runs between captured graphs, often enough that no contact can be missed: nodes that move too far
between two searches raise a flag, which stops the run. On the CPU, stages 1, 2 and 4 and energies of stage 3 are cut
in ranges, which threads compute side by side; on a GPU, kernels of a graph begin while the one before them ends.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.base.errors import bad_value
from warp_mca.elements import ELEMENTS
from warp_mca.elements.stage import BLOCK_DIM as ELEMENT_BLOCK
from warp_mca.elements.stage import gather_lists
from warp_mca.kernels.contact import contact, search, spring
from warp_mca.kernels.hardware import subnormals
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.nodes import constraint, node, slide
from warp_mca.kernels.records import ledger, output
from warp_mca.model.layout import layout_of
from warp_mca.model.model import Model
from warp_mca.model.precision import limited
from warp_mca.runs.ledger import JACOBIAN, PASS, PASS_COLUMNS
from warp_mca.solve.bonds import BondStage
from warp_mca.solve.contact_stage import ContactStage, per_scene
from warp_mca.solve.early_launch import overlap
from warp_mca.solve.extremes import NormalForce
from warp_mca.solve.threads import ELEMENTS as RANGE
from warp_mca.solve.threads import NODES, Pool, Split, Stages, flushing, whole

if TYPE_CHECKING:
    from warp_mca.solve.output import Output

# Patches that a block of threads computes in turn, from which on blocks take their places while nodes are advanced:
# they do not spread evenly then, and few rounds do not level that out.
EARLY_ROUNDS = 8
ROWS = 32  # records kept on the device before the host reads them


def check_device(name: str) -> str:
    """The name of a device that this machine has.

    Raises:
        RequestError: there is no such device.
    """
    wp.init()
    known = [str(device) for device in wp.get_devices()]
    if name not in known:
        raise bad_value("device", name, f"this machine has {', '.join(known)}")
    return name


class Solver:
    """Advances a model on one device.

    Attributes:
        u: displacements since hand-off [m], shape (node_count,), vec3d.
        v: velocities at the last half step [m/s], shape (node_count,), vec3d.
        dt: time step [s].
        output: what is read off the state for paths and recorders, or None.
        threads: that compute; one on a GPU, and for a model that is too small to gain from more.
    """

    def __init__(self, model: Model, *, device: str, precision: str, dt: float, threads: int = 1) -> None:
        if precision not in ("mixed", "float64"):
            raise bad_value("precision", precision, "choose mixed or float64")
        self.model, self.device, self.precision, self.dt = model, check_device(device), precision, dt
        self.layout = layout_of(model)
        largest = max(block.conn.shape[1] for block in model.blocks)
        self.threads = 1 if wp.get_device(self.device).is_cuda else max(1, min(threads, largest // RANGE))
        with wp.ScopedDevice(self.device):
            self._allocate()
        self.graphs: dict[str, Any] = {}
        self.stages: dict[str, Stages] = {}
        self.pool = Pool(self.threads) if self.threads > 1 else None
        self._flushing: AbstractContextManager[object] | None = None
        self.output: Output | None = None

    def _allocate(self) -> None:
        model = self.model
        t = scalars(self.precision)
        self.X = wp.array(model.X, dtype=wp.vec3d)
        self.u = wp.zeros(model.node_count, dtype=wp.vec3d)
        self.v = wp.array(model.V, dtype=wp.vec3d)
        self.v_before = wp.zeros(model.node_count, dtype=wp.vec3d)
        self.mass = wp.array(model.mass, dtype=wp.float64)
        self.inverse_mass = wp.array(1.0 / model.mass, dtype=wp.float64)
        self.law = wp.array(limited(model.law, self.precision), dtype=t.real)
        self.elements = [ELEMENTS[block.element].stage(block, model.X, self.precision) for block in model.blocks]
        near, more = gather_lists(self.elements, model.node_count)
        self.near, self.more = wp.array(near, dtype=wp.vec2i), wp.array(more, dtype=wp.vec4i)
        self.force = wp.zeros(sum(len(stage.slot_node) for stage in self.elements), dtype=t.vec3)
        scenes, passes = self.layout.count, len(model.passes) // self.layout.count
        self.contacts = [ContactStage(model.passes[k::passes], model, PASS + PASS_COLUMNS * k) for k in range(passes)]
        if self.contacts:
            blocks = max(stage.blocks for stage in self.contacts)
            for stage in self.elements:
                stage.make_room(blocks)
        # contact and sums have few threads and wait long for memory: they take what room there is first
        cuda = wp.get_device().is_cuda
        self.side, self.sums = (wp.Stream(priority=-1), wp.Stream(priority=-1)) if cuda else (None, None)
        self.contact_force = wp.zeros(model.node_count if self.contacts else 0, dtype=wp.vec3d)
        by_scene = [model.passes[k * passes : (k + 1) * passes] for k in range(scenes)]
        self.normal_force = NormalForce(by_scene if passes else [], self.threads)
        # threads of a GPU share an entry: few of them exceed it
        self.speed_square = wp.zeros(1 if cuda and scenes == 1 else model.node_count, dtype=wp.float32)
        self.flag = wp.zeros((scenes, len(search.FLAGS)), dtype=wp.int32)
        self.bonds = BondStage(model, self.layout)
        self.energy = wp.zeros((5, model.element_count), dtype=t.real)
        self.row = wp.full(1, ROWS - 1, dtype=wp.int32)  # of the latest record
        columns = PASS + PASS_COLUMNS * len(self.contacts)
        self.partial = wp.zeros((ROWS, scenes, columns, ledger.SUM_WIDTH), dtype=wp.float64)
        self.partial[:, :, JACOBIAN].fill_(1.0)  # runs beyond the last are never written
        self.node_first = wp.array(self.layout.nodes, dtype=wp.int32)
        self.element_ranges = wp.array(self.layout.elements, dtype=wp.int32)
        self.most_nodes = int(np.diff(self.layout.nodes).max())  # of any scene
        self.most_elements = int(np.diff(self.layout.elements).sum(axis=(1, 2)).max())
        self.point_node = wp.array(np.maximum(model.points, 0), dtype=wp.int32)
        self.point_velocity = wp.zeros((ROWS, len(model.points)), dtype=wp.vec3d)
        self.gravity = wp.array(model.gravity, dtype=wp.vec3d)
        each = bool((model.gravity != model.gravity[0]).any())
        self.node_gravity = self.gravity if each else wp.vec3d(*model.gravity[0])
        self.node_scene = per_scene(self.layout.nodes) if each else 0
        touched, fixed, bound = bool(self.contacts), bool(model.fixed_axes.any()), self.bonds.count > 0
        rounds = min(0 if stage.block.plastic else stage.rounds for stage in self.elements)
        early = not touched and not bound and rounds >= EARLY_ROUNDS
        self.integrate_kernel = node.integrate_kernel(self.precision, touched, fixed, bound, each, early)
        self.bound_kernel = (
            constraint.bound_kernel(self.precision, touched, each, self.bonds.partial) if bound else None
        )
        self.sum_elements_kernel = ledger.sum_elements_kernel(self.precision)

    def _forces(self, split: Split = whole, beside: Callable[[], None] | None = None) -> None:
        """Elements; contact and what is launched `beside` in a stream of their own, where there is one.

        Elements go first: blocks of threads that find a multiprocessor at rest divide its memory as they want it, and
        patches want another division than contact.
        """
        side = self.side if self.contacts or beside else None
        before = wp.record_event() if side else None
        for stage in self.elements:
            stage.forces(self.X, self.law, self.u, self.force, split)
        with wp.ScopedStream(side, sync_enter=False):
            if before:
                wp.wait_event(before)
            for contact in self.contacts:
                outputs = self.contact_force, self.normal_force, self.flag
                contact.touch(self.X, self.u, self.v, self.dt, *outputs, split)
            if beside:
                beside()
        if side:
            wp.wait_stream(side)

    def _integrate(
        self, kick: float, drift: float, role: wp.array, split: Split = whole, before: wp.array | None = None
    ) -> None:
        def launch(part: slice) -> None:
            scene = 0 if isinstance(self.node_scene, int) else self.node_scene[part]
            contact_force = self.contact_force[part] if self.contacts else self.contact_force
            inputs = [self.inverse_mass[part], self.near[part], self.more]
            inputs += [role[part] if len(role) else role, self.force, scene, self.node_gravity, kick, drift]
            outputs = [contact_force, self.u[part], self.v[part], None if before is None else before[part]]
            keepers = node.KEEPERS if self.contacts and part.start == 0 else 0
            outputs += [
                self.speed_square[part] if len(self.speed_square) > 1 else self.speed_square,
                self.normal_force.array if keepers else None,
            ]
            threads = part.stop - part.start + keepers
            wp.launch(self.integrate_kernel, threads, inputs=inputs, outputs=outputs, block_dim=ELEMENT_BLOCK)

        split(self.model.node_count, launch, NODES)

    def _advance_bound(self, before: wp.array | None = None) -> None:
        inputs = [self.mass, self.inverse_mass, self.near, self.more, self.bonds.role, self.force, self.node_scene]
        inputs += [self.node_gravity, self.bonds.bonds, self.dt]
        outputs = [self.contact_force, self.u, self.v, before, self.speed_square, *self.bonds.counts()]
        wp.launch(self.bound_kernel, self.bonds.count, inputs=inputs, outputs=outputs, block_dim=ELEMENT_BLOCK)
        if len(self.bonds.rails):
            inputs = [self.X, self.mass, self.bonds.bonds.first, self.bonds.rails, self.dt]
            outputs = [self.u, self.v, self.speed_square, self.bonds.impulse]
            wp.launch(slide.slide, len(self.bonds.rails), inputs=inputs, outputs=outputs)

    def _advance(self, split: Split = whole, before: wp.array | None = None) -> None:
        """Advance all nodes by a step, those that are bound beside the others; `before` takes their velocities."""
        if self.bound_kernel:
            with wp.ScopedStream(self.side):
                self._advance_bound(before)
        self._integrate(self.dt, self.dt, self.bonds.role, split, before)
        if self.bound_kernel and self.side:
            wp.wait_stream(self.side)

    def _step(self, split: Split = whole) -> None:
        self._forces(split)
        self._advance(split)

    def _sum(self, kernel: Any, largest: int, inputs: list[Any], *outputs: wp.array) -> None:
        """Sums of each run of entries, by a block of threads each; no scene has more entries than `largest`."""
        runs = min(max(-(-largest // ledger.RUN), 1), ledger.SUM_WIDTH)
        threads = (self.layout.count, runs, ledger.RUN if self.side else 1)
        wp.launch(kernel, threads, inputs=[self.row, *inputs], outputs=[self.partial, *outputs])

    def _next_row(self) -> None:
        wp.launch(ledger.advance_row, 1, inputs=[ROWS], outputs=[self.row])

    def _record_step(self, needs: frozenset[str], is_row: bool = True, split: Split = whole) -> None:
        """One step that also writes a record of the state at its start, and a frame of `needs`.

        Where the record is no row of the history, what is summed over an output interval goes on, and paths are left.
        """
        self._forces(split, self._next_row)
        if self.output and is_row:
            self.output.before_step(needs)
        for stage in self.elements:
            stage.energies(self.X, self.law, self.u, self.energy, split)
        with wp.ScopedStream(self.sums):
            for touching in self.contacts:
                springs = [touching.column, touching.first, is_row, touching.spring]
                self._sum(spring.sum_springs, int(np.diff(touching.springs).max()), springs)
            self._sum(self.sum_elements_kernel, self.most_elements, [self.energy, self.element_ranges])
        self._advance(split, self.v_before)
        motion = [self.mass, self.gravity, self.u, self.v_before, self.v, self.dt, self.node_first]
        motion += [self.bonds.work, self.bonds.driven_first, self.point_node]
        self._sum(ledger.record_motion, self.most_nodes, motion, self.point_velocity)
        if self.output and is_row:
            self.output.after_step(needs)
        if self.sums:
            wp.wait_stream(self.sums)

    def _schedule(self) -> None:
        for stage in self.elements:
            stage.schedule()

    def _launch(self, name: str, body: Callable[[], None]) -> None:
        """Replay the graph `name`, captured from `body` at its first use."""
        with wp.ScopedDevice(self.device):
            if name not in self.graphs:
                with wp.ScopedCapture() as capture:
                    body()
                overlap(capture.graph)
                self.graphs[name] = capture.graph
            with self._flush():
                wp.capture_launch(self.graphs[name])

    def _replay(self, pool: Pool, name: str, body: Callable[[Split], None], count: int = 1) -> None:
        """Replay the stages `name`, captured from `body` at their first use, `count` times with all threads."""
        with wp.ScopedDevice(self.device):
            if name not in self.stages:
                self.stages[name] = Stages(self.threads, body)
            with self._flush():
                for _ in range(count):
                    self.stages[name].replay(pool)

    def _flush(self) -> AbstractContextManager[object]:
        """Made at its first use, when `compile` has loaded what it needs."""
        self._flushing = self._flushing or flushing(self.device)
        return self._flushing

    def compile(self) -> None:
        """Load every kernel that a step needs, so that capture finds them ready."""
        with wp.ScopedDevice(self.device):
            for kernels, size in self._kernels():
                if modules := list(dict.fromkeys(kernel.module for kernel in kernels)):
                    wp.force_load(self.device, modules, block_dim=size)  # side by side, where they must be compiled
        self.search()

    @property
    def _shows_stress(self) -> bool:
        return bool(self.output and self.output.arrays)

    def _kernels(self) -> list[tuple[list[Any], int | None]]:
        """One of each module with the threads of its blocks, None for Warp's own number: it is compiled for one."""
        sums = [ledger.record_motion, spring.sum_springs, self.sum_elements_kernel]
        sums += [output.nodal_stress] if self._shows_stress else []
        sums += [slide.slide] if len(self.bonds.rails) else []
        sums += [] if self.side else [subnormals.begin_flush]
        elements = [kernel for stage in self.elements for kernel in stage.kernels()]
        elements += [stage.stress_kernel for stage in self.elements if self._shows_stress]
        nodes = [self.integrate_kernel, *([self.bound_kernel] if self.bound_kernel else [])]
        return [
            (sums + [kernel for stage in self.contacts for kernel in stage.search_kernels()], None),
            (nodes + elements, ELEMENT_BLOCK),
            ([kernel for stage in self.contacts for kernel in stage.kernels()], contact.BLOCK_DIM),
        ]

    def search(self) -> None:
        """Broad phase of every contact."""
        with wp.ScopedDevice(self.device):
            for stage in self.contacts:
                stage.search(self.X, self.u, self.flag)

    def initial_depths(self) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Of each contact, depth [m] and energy [J] of every spring at the start; nothing of the state changes."""
        with wp.ScopedDevice(self.device):
            force, flag = wp.zeros_like(self.contact_force), wp.zeros_like(self.flag)
            inputs = [self.X, self.u, self.v, force, self.normal_force, flag]
            found = [stage.initial_depths(*inputs) for stage in self.contacts]
            self.normal_force.array.zero_()
            return found

    def start(self) -> None:
        """Take the velocities half a step back, from t = 0 to t = -dt / 2, as central differences hold them.

        Bodies are free of stress then.
        """
        with wp.ScopedDevice(self.device):
            self._integrate(-0.5 * self.dt, 0.0, self.bonds.at_rest)
            speeds = (self.model.V**2).sum(axis=1)  # not those before the start
            self.speed_square.assign(speeds if len(self.speed_square) > 1 else speeds.max(keepdims=True))

    def record_and_step(self, count: int, needs: frozenset[str] = frozenset(), is_row: bool = True) -> None:
        """Record the state, as a row of the history or as a check between two, then advance `count` steps.

        A row may come with a frame of `needs`.

        Raises:
            Exception: what a thread raised.
        """
        name = f"{'record' if is_row else 'check'} {sorted(needs)}"
        if self.pool:
            self._replay(self.pool, name, lambda split: self._record_step(needs, is_row, split))
            self.step(count - 1)
            return

        def interval() -> None:
            self._schedule()
            self._record_step(needs, is_row)
            for _ in range(count - 1):
                self._step()

        self._launch(f"{name} {count}", interval)

    def step(self, count: int) -> None:
        """Advance `count` steps.

        Raises:
            Exception: what a thread raised.
        """
        if self.pool:
            self._replay(self.pool, "step", self._step, count)
            return

        def steps() -> None:
            self._schedule()
            for _ in range(count):
                self._step()

        self._launch(f"step {count}", steps)

    def records(self) -> dict[str, wp.array]:
        """Rings of ROWS records, which wrap, and the flags raised so far.

        Returns:
            `partial`: partial sums, shape (ROWS, scene_count, columns, SUM_WIDTH), float64; `point_velocity` [m/s],
            shape (ROWS, point_count), vec3d; `flag`, shape (scene_count, 4), int32; `path_stress` [Pa], where the scene
            has paths, shape (ROWS, probe_count), vec6 of float32.
        """
        found = {"partial": self.partial, "point_velocity": self.point_velocity, "flag": self.flag}
        if self.output and self.output.has_probes:
            found["path_stress"] = self.output.path_stress
        return found

    def max_plastic_strain(self, scene: int = 0) -> float:
        """Greatest equivalent plastic strain of any integration point of a scene [-]."""
        ranges = zip(self.elements, self.layout.elements[scene].tolist(), strict=True)
        return max(s.max_plastic_strain(slice(a - s.block.first, b - s.block.first)) for s, (a, b) in ranges)

    def max_penetration(self, scene: int = 0) -> float:
        """Greatest depth that a slave node of a scene reached below its master [m]."""
        return max((float(stage.depths(scene).max()) for stage in self.contacts), default=0.0)

    def max_normal_force(self, scene: int = 0) -> float:
        """Greatest sum of the normal forces on all slave nodes of a scene in any step [N]."""
        return self.normal_force.greatest(scene)

    def max_speed(self, scene: int = 0) -> float:
        """Greatest speed of any node of a scene, from the start on [m/s]."""
        first, end = self.layout.nodes[scene : scene + 2]
        squares = self.speed_square.numpy()
        return math.sqrt(squares[first:end].max() if len(squares) > 1 else squares[0])

    def joint_impulses(self, scene: int = 0) -> dict[str, list[float]]:
        """Impulse that each joint of a scene gave to its first body [N s], by name."""
        impulse = self.bonds.impulse.numpy()
        hinges = self.model.hinges[self.layout.hinges[scene] : self.layout.hinges[scene + 1]]
        return {h.name: impulse[h.start : h.end].sum(axis=0).tolist() for h in hinges}

    def device_name(self) -> str:
        """The device, with what it is."""
        device = wp.get_device(self.device)
        return f"{self.device} ({device.name})"
