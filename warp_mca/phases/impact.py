"""Owns the impact phase: a solver, and the state that it advances."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import GuardError, bad_value
from warp_mca.base.garbage import few_collections
from warp_mca.base.joining import offsets
from warp_mca.model.batch_model import join_models, with_alike_passes
from warp_mca.model.paths import join_probes
from warp_mca.model.sensors import join_sensors
from warp_mca.phases.controls import Controls
from warp_mca.phases.division import divide_alike
from warp_mca.phases.exposed import Exposed
from warp_mca.phases.impact_loop import Loop
from warp_mca.phases.initial_overlap import settle_initial_overlap
from warp_mca.phases.scene_run import SceneRun
from warp_mca.physics.floating.frames import with_floating_frames
from warp_mca.step.output import Output
from warp_mca.step.sensor_stage import SensorStage
from warp_mca.step.solver import Solver
from warp_mca.step.state_figures import at_last_record
from warp_mca.step.steps import Steps
from warp_mca.step.transfer import Transfer
from warp_mca.system.reading import on_host
from warp_mca.system.records import SceneRecords
from warp_mca.system.state import State
from warp_mca.watch.bent_scenes import Together
from warp_mca.watch.looks import Looks
from warp_mca.watch.passing import Watch

if TYPE_CHECKING:
    import os

    from warp_mca.phases.prepare import Prepared
    from warp_mca.recorders.frames import Recording
    from warp_mca.recorders.recorder import SurfaceMesh


Array = NDArray[np.float64]
SETS = 5  # of records that the scenes of a batch take in at once, at most


class Impact:
    """The impact phase of one scene, or of those of a batch side by side.

    Attributes:
        ready: the scenes at its start.
        span: simulated time that was asked for [s].
        steps: how it is divided.
        solver: that advances it.
        state: all that changes.
        scene_runs: records and result of each scene.
        stopped: which guard stopped each scene, in one sentence, or None.
        recording: recorders of a lone scene, or None.
        controls: what asks controllers, of which a batch has none.
        exposed: what follows the surface of a lone scene's elements as they fail, or None.
        ways: how records and looks came to the host in the latest call of `advance`; the next one takes them if it can.
    """

    recording: Recording | None = None
    ways: tuple[Transfer[str], Looks] | None = None

    def __init__(
        self,
        ready: Sequence[Prepared],
        span: float,
        *,
        device: str,
        precision: str,
        threads: int,
        skins: Mapping[str, SurfaceMesh] | None = None,
        needs: frozenset[str] = frozenset(),
        shape: Callable[[Solver, State], None] | None = None,
    ) -> None:
        """Allocate, compile and settle what overlaps.

        Args:
            ready: scenes with the same output interval and contacts of the same kinds.
            span: simulated time [s].
            device, precision, threads: as in `warp_mca.run`; threads are not None.
            skins: surfaces of bodies that recorders show, by body.
            needs: of recorders.
            shape: gives the new state what earlier impacts left, and springs that press what then overlaps; None for
                bodies without displacement or stress.

        Raises:
            RequestError: steps cannot be chosen, or bodies overlap that must not.
        """
        alike = with_alike_passes([item.model for item in ready])
        ready = [item.with_model(model) for item, model in zip(ready, alike, strict=True)]
        self.ready = tuple(ready)
        self.steps = divide_alike([(item.scene, item.model) for item in ready], span)
        model = join_models([item.model for item in ready])
        model = with_floating_frames(model, [item.scene for item in ready], span, precision)
        self.solver = Solver(model, device=device, precision=precision, dt=self.steps.dt, threads=threads)
        probes = join_probes([(item.probes, item.model.node_count) for item in ready])
        if skins or len(probes.corner):
            self.solver.output = Output(self.solver, skins or {}, probes, needs)
        if any(item.sensors.channels for item in ready):
            sensors = join_sensors([(item.sensors, item.model) for item in ready])
            self.solver.sensors = SensorStage(self.solver, sensors)
        self.solver.compile()
        self.state = self.solver.new_state()
        if shape:
            shape(self.solver, self.state)
        self.solver.begin(self.state)
        if not shape:
            settle_initial_overlap(self.ready, self.solver, self.state)
        self.solver.start(self.state)
        self.controls = Controls(self.ready[0].scene, self.state)
        self.exposed = Exposed(self.ready[0], self.solver, self.state) if model.fails and len(ready) == 1 else None
        self.stopped: list[str | None] = [None] * len(self.ready)
        self._room: dict[str, NDArray] = {}  # for the records of SETS sets, used again and again
        self._held, self._sets = 0, 1  # one set at first, so that scenes that break at once end the run at once
        self.span = span
        self._watches = [
            Watch(k.scene, k.meshes, k.model, self.solver.dt, span, k.skins, k.home.nodes if k.home else None)
            for k in ready
        ]
        self._begin_scenes()

    @cached_property
    def together(self) -> Together:
        """Cells of several scenes whose bending this process looks at."""
        return Together(
            [(item.ledger.model, () if item.looks.home else item.looks.samples) for item in self.scene_runs]
        )

    def look_at_the_end(self) -> None:
        """Look at the bending of the scenes of a batch, for their results; a lone one and helpers look themselves."""
        looks = [item.looks for item in self.scene_runs]
        for item in looks:
            item.last = item.ledger.kept.stiffened if item.home else None
        if len(looks) > 1 and any(item.samples for item in looks if not item.home):
            before = [item.ledger.kept.stiffened for item in looks]
            u = np.asarray(on_host(self.state.u), dtype=np.float64)
            for item, found in zip(looks, self.together.seen(u, before), strict=True):
                item.last = found

    def _begin_scenes(self) -> None:
        first = offsets([len(item.probes.corner) for item in self.ready])
        channel = offsets([item.sensors.channels for item in self.ready])
        self.scene_runs = [
            SceneRun(item, self.steps, self.solver, self.state, self._watches[k], k, int(first[k]), int(channel[k]))
            for k, item in enumerate(self.ready)
        ]

    def load(self, path: str | os.PathLike[str]) -> None:
        """Go on from a state that `save` stored.

        Raises:
            RequestError: as in `State.load`; a controller gives other numbers than before.
        """
        if self.exposed and Path(path).is_file() and (skins := self.exposed.restore(path)) is not None:
            self._watches[0].renew(skins, self.exposed.passes, np.zeros((0, 6)))
        self.state.load(path, self.solver.model, self.solver.dt)
        self.controls.restore(path)
        self.stopped = [None] * len(self.ready)
        self._begin_scenes()

    def save(self, path: str | os.PathLike[str], more: Mapping[str, NDArray] | None = None) -> None:
        """Store the state, and `more` arrays with it, between two calls of `advance`.

        Raises:
            OSError: the file cannot be written.
        """
        self.state.save(path, self.solver.model, self.solver.dt, {**(more or {}), **self.controls.arrays()})

    def divide_anew(self, steps: Steps) -> list[SceneRecords]:
        """Go on with other intervals of the same time step: rows and peaks of stress begin anew, energies and extremes
        go on.

        Returns:
            What each scene has recorded so far.
        """
        earlier = self.state.scenes
        self.state.scenes = [records.without_rows(self.state.steps * self.solver.dt) for records in earlier]
        self.state.steps = 0
        for own in self.state.elements:
            own.peak.zero_()
        self.take(steps)
        return earlier

    def take(self, steps: Steps) -> None:
        """Divide the phase, what is done of it included, by intervals of the same time step."""
        self.steps = steps
        self._begin_scenes()

    @property
    def rows(self) -> int:
        """Rows of the history so far, the most of any scene."""
        return max(item.ledger.kept.count for item in self.scene_runs)

    def advance(
        self, until: int | None = None, told: Callable[[], None] = lambda: None, ended: Callable[[], bool] | None = None
    ) -> None:
        """Search for contact, record and step, until so many steps are done, or all.

        Args:
            until: number of steps since the start of the phase at which to pause; all if None.
            told: called when records have been read.
            ended: asked at each row of the history whether the phase ends there; records are then read as they come.

        Raises:
            RequestError: all steps are taken already, and it is to pause later.
        """
        whole = self.steps.count
        if until is not None and until > whole and None in self.stopped and self.state.steps > whole:
            raise bad_value("Impact.steps.count", self.steps.count, "all are taken; let Impact.take give it more")
        if None not in self.stopped or self.state.steps > self.steps.count:
            return  # with the last record of all
        with suppress(GuardError), few_collections():  # the error is that of the last scene
            Loop(self, told, ended).run(until)

    def at_last_record(self) -> tuple[Array, Array]:
        """Displacements and velocities of the nodes, as `step.state_figures.at_last_record` has them."""
        return at_last_record(self.solver, self.state)

    def read(self, written: int, records: Mapping[str, NDArray]) -> None:
        """Hand records to each scene that no guard has stopped; of a batch, those of several sets at once.

        What a record of a small scene costs is calls of numpy. Flags are told as soon as they are raised.

        Raises:
            GuardError: a guard stops the last one.
        """
        if "path_stress" in records:
            for k, scene_run in enumerate(self.scene_runs):
                if self.stopped[k] is None:
                    scene_run.stress.take(written, records["path_stress"])
        if len(self.scene_runs) == 1:
            return self._hand_over(written, records)
        raised = bool(records["flag"][:, :-1].any())
        if raised:
            self.read_rest()
        held, self._room["flag"] = self._held, records["flag"].copy()
        for name in records.keys() - {"path_stress", "flag"}:
            array = records[name]
            if name not in self._room:
                self._room[name] = np.empty((SETS * len(array), *array.shape[1:]), dtype=array.dtype)
            self._room[name][held : held + written] = array[:written]
        self._held += written
        if raised or self._held + len(records["partial"]) > self._sets * len(records["partial"]):
            self._sets = min(self._sets + 1, SETS)
            self.read_rest()

    def read_rest(self) -> None:
        """Hand over what is held of a batch; raises as `read`."""
        held, self._held = self._held, 0
        if held:
            self._hand_over(held, {name: a if name == "flag" else a[:held] for name, a in self._room.items()})

    def _hand_over(self, written: int, records: Mapping[str, NDArray]) -> None:
        for k, scene_run in enumerate(self.scene_runs):
            if self.stopped[k] is None:
                try:
                    scene_run.read(written, records)
                except GuardError as error:
                    self.stopped[k] = str(error)
                    if None not in self.stopped:
                        raise
