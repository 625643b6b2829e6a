"""Owns one time step: the ordered stages that advance a state of a model on one device.

docs/architecture.md lists the stages. The broad-phase search runs between captured graphs, often enough that no contact
can be missed: nodes that move too far between two searches raise a flag, which stops the run. On the CPU, elements,
contact, nodes and energies are cut in ranges, which threads compute side by side; on a GPU, kernels of a graph begin
while the one before them ends.
"""

from __future__ import annotations

import math
import weakref
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
from warp_mca.kernels.contact import contact
from warp_mca.kernels.contact.search import FLAGS
from warp_mca.kernels.hardware import subnormals
from warp_mca.kernels.nodes import slide
from warp_mca.kernels.records import output
from warp_mca.model.layout import layout_of
from warp_mca.model.model import Model
from warp_mca.solve.bonds import BondStage
from warp_mca.solve.contact_stage import ContactStage
from warp_mca.solve.early_launch import launch_early
from warp_mca.solve.extremes import NormalForce
from warp_mca.solve.load_stage import LoadStage
from warp_mca.solve.node_stage import NodeStage
from warp_mca.solve.record_stage import RecordStage
from warp_mca.solve.records import SceneRecords
from warp_mca.solve.stage import BESIDE, SUMS, Group, Stage, Step, Streams
from warp_mca.solve.state import State
from warp_mca.solve.threads import ELEMENTS as RANGE
from warp_mca.solve.threads import Pool, Split, Stages, flushing, whole
from warp_mca.solve.workspace import Workspace

if TYPE_CHECKING:
    from warp_mca.solve.output import Output


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
    """Advances states of a model on one device; it owns nothing that changes from step to step.

    Attributes:
        model: that it advances.
        layout: of the model's scenes.
        dt: time step [s].
        threads: that compute; one on a GPU, and for a model that is too small to gain from more.
        work: the model on the device, and what a step computes and forgets.
        elements, contacts: stages of the model's blocks and contact passes.
        bonds: what binds nodes.
        loads: what acts in the joints of chains, and moves their bases.
        output: what is read off the state for paths and recorders, or None.
    """

    def __init__(self, model: Model, *, device: str, precision: str, dt: float, threads: int = 1) -> None:
        """Allocate.

        Raises:
            RequestError: there is no such device or precision.
        """
        if precision not in ("mixed", "float64"):
            raise bad_value("precision", precision, "choose mixed or float64")
        self.model, self.device, self.precision, self.dt = model, check_device(device), precision, dt
        self.layout = layout_of(model)
        largest = max(block.conn.shape[1] for block in model.blocks)
        self.threads = 1 if wp.get_device(self.device).is_cuda else max(1, min(threads, largest // RANGE))
        self.output: Output | None = None
        with wp.ScopedDevice(self.device):
            self._allocate()
        self._graphs: weakref.WeakKeyDictionary[State, dict[str, Any]] = weakref.WeakKeyDictionary()
        self._pool = Pool(self.threads) if self.threads > 1 else None
        self._flushing: AbstractContextManager[object] | None = None

    def _allocate(self) -> None:
        model, passes = self.model, len(self.model.passes) // self.layout.count
        self.elements = [ELEMENTS[block.element].stage(block, model.X, self.precision) for block in model.blocks]
        for index, stage in enumerate(self.elements):
            stage.index = index
        first_slots, more_slots = gather_lists(self.elements, model.node_count)
        slots = sum(len(stage.slot_node) for stage in self.elements)
        self.work = Workspace(model, self.layout, self.precision, first_slots, more_slots, slots)
        scenes = [model.passes[k * passes : (k + 1) * passes] for k in range(self.layout.count)]
        self.normal_force = NormalForce(scenes if passes else [], self.threads)
        self.contacts = [ContactStage(model.passes[k::passes], model, k, self.normal_force) for k in range(passes)]
        if self.contacts:
            blocks = max(stage.blocks for stage in self.contacts)
            for stage in self.elements:
                stage.make_room(blocks)
        self.bonds = BondStage(model, self.layout)
        self.loads = LoadStage(model, self.layout.count, self.work, self.bonds, self.dt)
        self.nodes = NodeStage(model, self.work, self.bonds, self.precision, self.dt, self._early)
        self.records = RecordStage(model, self.layout, self.work, self.elements, self.precision)
        self.groups = self._groups()
        self._streams = Streams(wp.get_device().is_cuda)

    @property
    def _early(self) -> int:
        """Rounds of patches that the elements take, where nothing else waits for the nodes."""
        if self.contacts or self.bonds.count:
            return 0
        return min(0 if stage.block.plastic else stage.rounds for stage in self.elements)

    def _groups(self) -> list[Group]:
        """The stages of a step, in their order.

        Elements go before contact: blocks of threads that find a multiprocessor at rest divide its memory as they want
        it, and patches want another division than contact.
        """
        work = self.work
        forces = [Stage("element forces", lambda s, e=e: e.launch(work, s.state, s.split)) for e in self.elements]
        forces += [
            Stage("contact", lambda s, c=c: c.launch(work, s.state, self.dt, s.split), BESIDE) for c in self.contacts
        ]
        forces.append(Stage("next record", self.records.next_row, BESIDE, only_records=True))
        energies = [Stage("paths, frames: stress", self._before_step, only_records=True)]
        energies += [
            Stage("element energies", lambda s, e=e: e.energies(work, s.state, s.split), only_records=True)
            for e in self.elements
        ]
        sums = [
            Stage("spring sums", lambda s, c=c: self.records.sum_springs(s, c), SUMS, only_records=True)
            for c in self.contacts
        ]
        sums.append(Stage("element sums", self.records.sum_elements, SUMS, only_records=True))
        advance = [Stage("joints, driven nodes", self.nodes.advance_bound, BESIDE)] if self.bonds.count else []
        advance += [Stage("sliders on rails", self.nodes.slide, BESIDE)] if len(self.bonds.rails) else []
        advance += [Stage("bases", self.loads.move_bases, BESIDE)] if self.model.bases else []
        advance.append(Stage("free nodes", self.nodes.advance))
        motion = [
            Stage("motion sums", lambda s: self.records.sum_motion(s, self.bonds, self.dt), only_records=True),
            Stage("frames: velocity", self._after_step, only_records=True),
        ]
        if self.loads.kernels():
            motion.append(Stage("joint and base sums", self.loads.sums, only_records=True))
        torques = [Stage("joint torques", lambda s: self.loads.torques(s.state, self.dt, self.dt))]
        return [forces, energies, sums, advance, torques if self.model.hinge_loads else [], motion]

    def _before_step(self, step: Step) -> None:
        if self.output and step.is_row:
            self.output.before_step(step.state, step.needs)

    def _after_step(self, step: Step) -> None:
        if self.output and step.is_row:
            self.output.after_step(step.state, step.needs)

    def new_state(self) -> State:
        """State at the start of the phase: the model's velocities, no displacement, no stress."""
        with wp.ScopedDevice(self.device):
            single = wp.get_device().is_cuda and self.layout.count == 1
            return State(
                u=wp.zeros(self.model.node_count, dtype=wp.vec3d),
                v=wp.array(self.model.V, dtype=wp.vec3d),
                # threads of a GPU share an entry: few of them exceed it
                speed_square=wp.zeros(1 if single else self.model.node_count, dtype=wp.float32),
                normal_force=self.normal_force.new_state(),
                flag=wp.zeros((self.layout.count, len(FLAGS)), dtype=wp.int32),
                elements=[stage.new_state() for stage in self.elements],
                contacts=[stage.new_state() for stage in self.contacts],
                constraints=self.bonds.new_state(),
                loads=self.loads.new_state(),
                scenes=[SceneRecords() for _ in range(self.layout.count)],
            )

    def forces(self, state: State) -> None:
        """Forces of elements and contacts at the state's displacements, in `work`."""
        with wp.ScopedDevice(self.device):
            self._streams.run(self.groups[:1], Step(state))

    def _launch(self, state: State, name: str, body: Callable[[], None]) -> None:
        """Replay the graph `name` of a state, captured from `body` at its first use."""
        with wp.ScopedDevice(self.device):
            graphs = self._graphs.setdefault(state, {})
            if name not in graphs:
                with wp.ScopedCapture() as capture:
                    body()
                launch_early(capture.graph)
                graphs[name] = capture.graph
            with self._flush():
                wp.capture_launch(graphs[name])

    def _replay(self, state: State, pool: Pool, name: str, body: Callable[[Split], None], count: int = 1) -> None:
        """Replay the stages `name`, captured from `body` at their first use, `count` times with all threads."""
        with wp.ScopedDevice(self.device):
            graphs = self._graphs.setdefault(state, {})
            if name not in graphs:
                graphs[name] = Stages(self.threads, body)
            with self._flush():
                for _ in range(count):
                    graphs[name].replay(pool)

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

    def _kernels(self) -> list[tuple[list[Any], int | None]]:
        """One of each module with the threads of its blocks, None for Warp's own number: it is compiled for one."""
        stress = bool(self.output and self.output.arrays)
        sums = self.records.kernels() + self.loads.kernels()
        sums += [slide.slide] if len(self.bonds.rails) else []
        sums += [output.nodal_stress] if stress else []
        sums += [] if wp.get_device().is_cuda else [subnormals.begin_flush]
        elements = [kernel for stage in self.elements for kernel in stage.kernels()]
        elements += [stage.stress_kernel for stage in self.elements if stress]
        return [
            (sums + [kernel for stage in self.contacts for kernel in stage.search_kernels()], None),
            (self.nodes.kernels() + elements, ELEMENT_BLOCK),
            ([kernel for stage in self.contacts for kernel in stage.kernels()], contact.BLOCK_DIM),
        ]

    def search(self, state: State) -> None:
        """Broad phase of every contact."""
        with wp.ScopedDevice(self.device):
            for stage in self.contacts:
                stage.search(self.work, state)

    def initial_depths(self, state: State) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Of each contact, depth [m] and energy [J] of every spring at the start; the state does not change."""
        with wp.ScopedDevice(self.device):
            tried = state.copy()
            for stage in self.contacts:
                stage.launch(self.work, tried, 0.0)
            self.work.contact_force.zero_()
            springs = [own.spring for own in tried.contacts]
            return [(spring.depth.numpy(), spring.energy.numpy()) for spring in springs]

    def begin(self, state: State) -> None:
        """First search of a new state, after `compile`."""
        self.search(state)
        with wp.ScopedDevice(self.device):
            for stage in self.contacts:
                stage.begin(self.work, state)

    def start(self, state: State) -> None:
        """Take the velocities half a step back, from t = 0 to t = -dt / 2, as central differences hold them.

        Bodies are free of stress then, so that gravity and the drives of joints alone accelerate them.
        """
        with wp.ScopedDevice(self.device):
            self.work.force.zero_()  # of a state that was advanced before
            self.nodes.integrate(state, -0.5 * self.dt, 0.0, self.bonds.at_rest)
            if self.model.hinge_loads:
                self.loads.torques(state, -0.5 * self.dt, 0.0)
            speeds = (self.model.V**2).sum(axis=1)  # not those before the start
            squares = state.speed_square
            squares.assign(speeds if len(squares) > 1 else speeds.max(keepdims=True))

    def _step(self, step: Step) -> None:
        self._streams.run(self.groups, step)

    def _schedule(self) -> None:
        for stage in self.elements:
            stage.schedule()

    def record_and_step(
        self, state: State, count: int, needs: frozenset[str] = frozenset(), is_row: bool = True
    ) -> None:
        """Record the state, as a row of the history or as a check between two, then advance `count` steps.

        A row may come with a frame of `needs`.

        Raises:
            Exception: what a thread raised.
        """
        name = f"{'record' if is_row else 'check'} {sorted(needs)}"

        def record(split: Split = whole) -> None:
            self._step(Step(state, split, True, is_row, needs))

        if self._pool:
            self._replay(state, self._pool, name, record)
            state.steps += 1
            self.step(state, count - 1)
            return

        def interval() -> None:
            self._schedule()
            record()
            for _ in range(count - 1):
                self._step(Step(state))

        self._launch(state, f"{name} {count}", interval)
        state.steps += count

    def step(self, state: State, count: int) -> None:
        """Advance `count` steps.

        Raises:
            Exception: what a thread raised.
        """
        if self._pool:
            self._replay(state, self._pool, "step", lambda split: self._step(Step(state, split)), count)
        else:

            def steps() -> None:
                self._schedule()
                for _ in range(count):
                    self._step(Step(state))

            self._launch(state, f"step {count}", steps)
        state.steps += count

    def rings(self, state: State) -> dict[str, wp.array]:
        """Rings of ROWS records, which wrap, and the flags raised so far.

        Returns:
            `partial`: partial sums, shape (ROWS, scene_count, columns, SUM_WIDTH), float64; `point_velocity` [m/s],
            shape (ROWS, point_count), vec3d; `flag`, shape (scene_count, 4), int32; `path_stress` [Pa], where the scene
            has paths, shape (ROWS, probe_count), vec6 of float32.
        """
        found = {"partial": self.work.partial, "point_velocity": self.work.point_velocity, "flag": state.flag}
        if self.output and self.output.has_probes:
            found["path_stress"] = self.output.path_stress
        return found

    def max_plastic_strain(self, state: State, scene: int = 0) -> float:
        """Greatest equivalent plastic strain of any integration point of a scene [-]."""
        ranges = zip(self.elements, self.layout.elements[scene].tolist(), strict=True)
        return max(s.max_plastic_strain(state, slice(a - s.block.first, b - s.block.first)) for s, (a, b) in ranges)

    def max_penetration(self, state: State, scene: int = 0) -> float:
        """Greatest depth that a slave node of a scene reached below its master [m]."""
        return max((float(stage.depths(state, scene).max()) for stage in self.contacts), default=0.0)

    def max_normal_force(self, state: State, scene: int = 0) -> float:
        """Greatest sum of the normal forces on all slave nodes of a scene in any step [N]."""
        return self.normal_force.greatest(state.normal_force, scene)

    def max_speed(self, state: State, scene: int = 0) -> float:
        """Greatest speed of any node of a scene, from the start on [m/s]."""
        first, end = self.layout.nodes[scene : scene + 2]
        squares = state.speed_square.numpy()
        return math.sqrt(squares[first:end].max() if len(squares) > 1 else squares[0])

    def joint_impulses(self, state: State, scene: int = 0) -> dict[str, list[float]]:
        """Impulse that each joint of a scene gave to its first body [N s], by name."""
        impulse = state.constraints.impulse.numpy()
        joints = self.model.joints[self.layout.joints[scene] : self.layout.joints[scene + 1]]
        return {joint.name: impulse[joint.start : joint.end].sum(axis=0).tolist() for joint in joints}

    def device_name(self) -> str:
        """The device, with what it is."""
        device = wp.get_device(self.device)
        return f"{self.device} ({device.name})"
