"""Owns one time step: the ordered stages that advance a state of a model on one device.

docs/architecture.md lists the stages. The broad-phase search runs between captured graphs, often enough that no contact
can be missed: nodes that move too far between two searches raise a flag, which stops the run. On the CPU, elements,
contact, nodes and energies are cut in ranges, which threads compute side by side; on a GPU, kernels of a graph begin
while the one before them ends.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_mca.base.errors import bad_value
from warp_mca.kernels.contact.search import FLAGS
from warp_mca.kernels.hardware import thread_pool
from warp_mca.physics.contact.stage import has_sides
from warp_mca.physics.elements.stage import gather_lists
from warp_mca.step.actors import Made, actors_of
from warp_mca.step.device import check_device
from warp_mca.step.rate_chains import Chains
from warp_mca.step.replay import MOST, Replay
from warp_mca.step.resident import resident
from warp_mca.step.sensor_stage import SensorStage
from warp_mca.step.step_groups import step_groups, substep
from warp_mca.system.actor import Actor, When
from warp_mca.system.layout import layout_of
from warp_mca.system.model import Model
from warp_mca.system.records import SceneRecords
from warp_mca.system.stage import Search, Step, Streams
from warp_mca.system.state import State
from warp_mca.system.threads import ELEMENTS as RANGE
from warp_mca.system.threads import Split, whole
from warp_mca.system.workspace import Workspace

if TYPE_CHECKING:
    from warp_mca.step.output import Output

BESIDE = 5  # steps that follow a record in its graph at least: a GPU goes on with them while it sums the record


class Solver(Made):
    """Advances states of a model on one device; it owns nothing that changes from step to step.

    Attributes:
        actors: all that acts, in the order of `step.actors.actors_of`.
        output: what is read off the state for paths and recorders, or None.
        sensors: probes and sections.
        replay: graphs of what is launched.
    """

    def __init__(self, model: Model, *, device: str, precision: str, dt: float, threads: int = 1) -> None:
        """Allocate.

        Raises:
            RequestError: there is no such device or precision.
        """
        if precision not in ("mixed", "float64"):
            raise bad_value("precision", precision, "choose mixed or float64")
        self.model, self.device, self.precision, self.dt = model, check_device(device), precision, dt
        self.layout, self.common_dt = layout_of(model), dt / model.common_steps
        largest = max((block.conn.shape[1] for block in model.blocks), default=0)
        self.threads = 1 if wp.get_device(self.device).is_cuda else max(1, min(threads, largest // RANGE))
        self.output: Output | None = None
        with wp.ScopedDevice(self.device):
            self._allocate()
        self.replay = Replay(self.device, self.threads)

    @cached_property
    def work(self) -> Workspace:
        """The model on the device, and what a step computes and forgets."""
        first_slots, more_slots = gather_lists(self.elements, self.model.node_count)
        slots = sum(len(stage.slot_node) for stage in self.elements)
        return Workspace(self.model, self.layout, self.precision, first_slots, more_slots, slots)

    def _allocate(self) -> None:
        model = self.model
        self.kinds = actors_of(model)
        self.sensors = SensorStage(self, ())
        self.actors: list[Actor] = [getattr(self, name) for name in self.kinds]
        if blocks := self.contacts.blocks + self.couplings.blocks:
            for stage in self.elements:
                stage.make_room(blocks)
        self.groups = step_groups(self.actors, When())
        cuda = wp.get_device().is_cuda
        self.chains = Chains(self) if model.rates and cuda else None
        levels = range(model.rates.top) if model.rates and not cuda else ()
        self.subgroups = [step_groups(self.actors, substep(model, level)) for level in levels]
        self._streams, self.resident = Streams(cuda), resident(self)

    def new_state(self) -> State:
        """State at the start of the phase: the model's velocities, no displacement, no stress."""
        with wp.ScopedDevice(self.device):
            single = wp.get_device().is_cuda and self.layout.count == 1
            return State(
                u=wp.zeros(self.model.node_count, dtype=wp.vec3d),
                v=wp.array(self.model.V, dtype=wp.vec3d),
                # threads of a GPU share an entry: few of them exceed it
                speed_square=wp.zeros(1 if single else self.model.node_count, dtype=wp.float32),
                normal_force=self.contacts.normal_force.new_state(),
                recent_force=wp.zeros(self.model.node_count if has_sides(self.model) else 0, dtype=wp.vec3d),
                flag=wp.zeros((self.layout.count, len(FLAGS)), dtype=wp.int32),
                parts={name: part for name in self.kinds if (part := getattr(self, name).new_state()) is not None},
                scenes=[SceneRecords() for _ in range(self.layout.count)],
            )

    def renew(self, state: State) -> None:
        """Go on with contact stages that are others than before, on the way of a state."""
        self.groups = step_groups(self.actors, When())
        self.replay.forget(state)
        self.compile()

    def forces(self, state: State) -> None:
        """Forces of elements and contacts at the state's displacements, in `work`."""
        with wp.ScopedDevice(self.device):
            self._streams.run(self.groups[:2], Step(state))

    def compile(self) -> None:
        """Load every kernel that a step needs, so that capture finds them ready."""
        with wp.ScopedDevice(self.device):
            by_size: dict[int | None, list[Any]] = {None: [] if wp.get_device().is_cuda else [thread_pool.lead]}
            by_size[None] += [kernel for actor in self.actors for kernel in actor.record_kernels()]
            kernels = [(actor.block_dim, actor.kernels()) for actor in self.actors]
            kernels += [self.resident.kernels()] if self.resident else []
            for size, some in kernels:
                by_size[size] = by_size.get(size, []) + some
            for size, some in by_size.items():  # a module is compiled for one number of threads
                if modules := list(dict.fromkeys(kernel.module for kernel in some)):
                    wp.force_load(self.device, modules, block_dim=size)

    def search(self, state: State) -> None:
        """Broad phase of every contact."""
        if self.replay.pool:
            with wp.ScopedDevice(self.device):
                self.contacts.find_boxes(state.u)  # no graph of a CPU holds what moves the trees of boxes
            self.replay.program(state, "search", lambda split: self.contacts.list_faces(state, state.u, split))
        elif self.contacts.is_replayable:
            self.replay.graph(state, "search", lambda: self.contacts.search_all(state))
        else:
            with wp.ScopedDevice(self.device):
                self.contacts.search_all(state)

    def begin(self, state: State) -> None:
        """First search of a new state, after `compile`."""
        self.search(state)
        with wp.ScopedDevice(self.device):
            for stage in self.contacts:
                stage.begin(self.work, state)

    @np.errstate(over="ignore")  # of speeds beyond float32, which are told or stopped elsewhere
    def start(self, state: State) -> None:
        """Take the velocities half a step back, from t = 0 to t = -dt / 2, as central differences hold them.

        Bodies are free of stress then, so that gravity, loads and the drives of joints alone accelerate them.
        """
        with wp.ScopedDevice(self.device):
            self.work.force.zero_()  # of a state that was advanced before
            for actor in self.actors:
                actor.start_forces(state)
            self.nodes.integrate(state, -0.5 * self.nodes.base, 0.0, self.constraints.at_rest)
            for actor in self.actors:
                actor.start(state)
            speeds = (self.model.V**2).sum(axis=1)  # not those before the start
            state.speed_square.assign(speeds if len(state.speed_square) > 1 else speeds.max(keepdims=True))

    @property
    def _captured(self) -> int:
        """Substeps of a step that graphs hold; none where one kernel takes all steps."""
        return self.chains.substeps if self.chains else int(not self.resident)

    def _step(self, step: Step) -> None:
        self._streams.run(self.groups, step)
        if self.chains:
            self.chains.run(Step(step.state), 1, self.chains.substeps)
            return
        for j in range(1, 1 << len(self.subgroups)):
            level = (j & -j).bit_length() - 1
            self._streams.run(self.subgroups[level], Step(step.state, step.split))

    def _steps(self, state: State, count: int) -> None:
        if self.resident and count:
            return self.resident.launch(state, count)
        if self.chains and count:
            return self.chains.run(Step(state), 0, count * self.chains.substeps)
        for _ in range(count):
            self._step(Step(state))

    def _schedule(self) -> None:
        for stage in () if self.chains else self.elements:  # with chains few launches are of all elements
            stage.schedule()

    def record_and_step(
        self,
        state: State,
        count: int,
        needs: frozenset[str] = frozenset(),
        is_row: bool = True,
        search: Search = "",
    ) -> None:
        """Record the state, as a row of the history or as a check between two, then advance `count` steps.

        A row may come with a frame of `needs`. With a `search` for contact a GPU computes other stages beside it:
        elements before contact has been computed, or nodes "after" that, where earlier lists serve one step more.

        Raises:
            Exception: what a thread raised.
        """
        most, beside = self.replay.most(state, count, self._captured, needs), max(1, BESIDE // max(1, self._captured))
        if count > (beside if needs else most):
            self.record_and_step(state, beside, needs, is_row, search)
            self.step(state, count - beside, most)
            return
        if search and not self.contacts.is_replayable:
            self.search(state)
            search = ""
        name = f"{'record' if is_row else 'check'} {sorted(needs)} {search}"

        def record(split: Split = whole) -> None:
            self._step(Step(state, split, True, is_row, needs, search))

        if self.replay.pool:
            self.replay.program(state, name, record)
            state.steps += 1
            self.step(state, count - 1)
            return

        def interval() -> None:
            self._schedule()
            record()
            self._steps(state, count - 1)
            self._streams.finish()

        self.replay.graph(state, f"{name} {count}", interval)
        state.steps += count

    def step(self, state: State, count: int, most: int = 0) -> None:
        """Advance `count` steps, in graphs of at most `most`, where a graph before has chosen the order of elements.

        Raises:
            Exception: what a thread raised.
        """
        if self.replay.pool:
            self.replay.program(state, "step", lambda split: self._step(Step(state, split)), count)
            state.steps += count
            return

        schedules, most = not most, most or self.replay.most(state, count, self._captured)

        def steps(count: int) -> None:
            if schedules:
                self._schedule()
            self._steps(state, count)

        for first in range(0, count, most):
            part = min(most, count - first)
            self.replay.graph(state, f"step {part} {schedules}", lambda part=part: steps(part))
            schedules = schedules and part == MOST  # a few more share an order
        state.steps += count

    def rings(self, state: State) -> dict[str, wp.array]:
        """Rings of ROWS records, which wrap, and the flags raised so far.

        Returns:
            `partial`: partial sums, shape (ROWS, scene_count, columns, run_count), float64; `point_velocity` [m/s],
            shape (ROWS, point_count), vec3d; `flag`, shape (scene_count, 4), int32; `path_stress` [Pa], where the scene
            has paths, shape (ROWS, probe_count), vec6 of float32; `sensors`, where it has probes or sections.
        """
        found = {"partial": self.work.partial, "point_velocity": self.work.point_velocity, "flag": state.flag}
        if self.output and self.output.has_probes:
            found["path_stress"] = self.output.path_stress
        return found | self.sensors.rings()
