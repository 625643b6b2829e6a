"""Solvers and impact phases without `run`, for tests that read the state that they leave."""

from __future__ import annotations

import json
import pickle
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path

import numpy as np
import warp as wp
from numpy.typing import NDArray

import warp_mca as mca
from warp_mca.kernels.hardware.simd import RANGE_MULTIPLE
from warp_mca.kernels.hardware.subnormals import flush, set_mode
from warp_mca.phases.impact import Impact
from warp_mca.phases.prepare import Clock, Prepared, Request, prepare
from warp_mca.phases.settings import Settings
from warp_mca.step.solver import Solver

# least lengths of ranges that threads take, so short that small models are cut
SHORT_RANGES = {
    "warp_mca.step.node_stage.NODES": RANGE_MULTIPLE,
    "warp_mca.step.solver.RANGE": RANGE_MULTIPLE,
    "warp_mca.physics.elements.stage.ELEMENTS": RANGE_MULTIPLE,
    "warp_mca.physics.elements.tet4_stage.ELEMENTS": RANGE_MULTIPLE,
    "warp_mca.physics.elements.tet4_stage.NODES": RANGE_MULTIPLE,
    "warp_mca.physics.contact.stage.CONTACT": RANGE_MULTIPLE // 2,
    "warp_mca.physics.contact.slave_edges.CONTACT": RANGE_MULTIPLE // 2,
    "warp_mca.physics.contact.edge_stage.CONTACT": RANGE_MULTIPLE // 2,
}


@wp.kernel(enable_backward=False)
def begin_flush(mode_out: wp.array(dtype=wp.uint32)):
    """Take subnormal numbers for zero in this thread."""
    mode_out[0] = flush()


@wp.kernel(enable_backward=False)
def end_flush(mode_out: wp.array(dtype=wp.uint32)):
    """Take them for what they were before."""
    mode_out[0] = set_mode(mode_out[0])


@contextmanager
def flushing() -> Iterator[None]:
    """Within it what is launched on a CPU takes subnormal numbers for zero, as steps do."""
    mode = wp.zeros(1, dtype=wp.uint32, device="cpu")
    wp.launch(begin_flush, 1, outputs=[mode], device="cpu")
    try:
        yield
    finally:
        wp.launch(end_flush, 1, outputs=[mode], device="cpu")


def prepared(
    scene: mca.Scene,
    meshes: Mapping[str, mca.Mesh] | None = None,
    duration: float | None = None,
    multi_rate: int | str | None = None,
    device: str = "cpu",
) -> Prepared:
    """A scene at the start of its impact phase."""
    span, settings = scene.impact.duration if duration is None else duration, Settings(device, "mixed", 1, multi_rate)
    return prepare(scene, meshes, Request(span=span, settings=settings))


def begun(
    *scenes: mca.Scene,
    meshes: Mapping[str, mca.Mesh] | None = None,
    duration: float | None = None,
    device: str = "cpu",
    precision: str = "mixed",
    threads: int = 1,
    multi_rate: int | str | None = None,
) -> Impact:
    """The impact phase of scenes side by side, before its first step."""
    span = scenes[0].impact.duration if duration is None else duration
    ready = [prepared(scene, meshes, span, multi_rate, device) for scene in scenes]
    return Impact(ready, span, device=device, precision=precision, threads=threads)


def finished(scene: mca.Scene, **settings) -> Impact:
    """The whole impact phase of a scene, settings as in `begun`.

    Raises:
        GuardError: a guard stopped it.
    """
    impact = begun(scene, **settings)
    impact.advance()
    if impact.stopped[0] is not None:
        raise mca.GuardError(impact.stopped[0])
    return impact


def result_of(impact: Impact, index: int = 0) -> mca.Result:
    """What came of a scene."""
    return impact.scene_runs[index].result(Clock().wall, stopped=impact.stopped[index])


def momentum(impact: Impact, first: int = 0, end: int | None = None) -> NDArray[np.float64]:
    """That of nodes first to end - 1 at the latest half step [kg m/s], shape (3,)."""
    return impact.solver.model.mass[first:end] @ impact.state.v.numpy()[first:end]


def figures(impact: Impact) -> dict[str, NDArray]:
    """What comes of a scene: histories, forces of each contact, stress along paths."""
    found = result_of(impact)
    arrays: dict[str, NDArray] = {f"history/{name}": column for name, column in found.history.items()}
    arrays |= {f"contacts/{k}": contact.force for k, contact in enumerate(found.contacts)}
    return arrays | {f"paths/{k}": path.stress for k, path in enumerate(found.paths)}


def go_on(folder: Path) -> None:
    """Continue the states <step>.state of a folder with the scene and settings.json there.

    Leaves <step>.end, the final state, and <step>.npz, its figures.
    """
    for name, length in SHORT_RANGES.items():
        module, _, constant = name.rpartition(".")
        setattr(import_module(module), constant, length)
    impact = begun(pickle.loads((folder / "scene").read_bytes()), **json.loads((folder / "settings.json").read_text()))
    for path in sorted(folder.glob("*.state")):
        impact.load(path)
        impact.advance()
        impact.save(path.with_suffix(".end"))
        np.savez(path.with_suffix(".npz"), **figures(impact))


class Displaced:
    """A solver and a state, whose displacements a test gives.

    Attributes:
        solver, state: as they are.
    """

    def __init__(self, solver: Solver) -> None:
        self.solver, self.state = solver, solver.new_state()

    def forces(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Forces of the elements on nodes [N] at displacements [m], shape (node_count, 3) both."""
        self.state.u.assign(u)
        self.solver.forces(self.state)
        force, total = self.solver.work.force.numpy().astype(float), np.zeros_like(u)
        for stage in self.solver.elements:
            np.add.at(total, stage.slot_node, force[stage.slot : stage.slot + len(stage.slot_node)])
        return total

    def energies(self) -> NDArray[np.floating]:
        """As `ElementStage.energies`, of all elements at the displacements of the latest forces."""
        self.solver.work.energy.zero_()
        with wp.ScopedDevice(self.solver.device):
            for stage in self.solver.elements:
                stage.energies(self.solver.work, self.state)
        return self.solver.work.energy.numpy()
