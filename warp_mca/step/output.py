"""Owns the device side of what is shown: stress at nodes, skins, probes and contact points, reduced on the device.

Only what a scene's paths and a run's recorders need is allocated and launched.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.kernels.records import output
from warp_mca.model.paths import Probes
from warp_mca.step.shown import CONTACT, PATHS, SURFACE, VOLUME, SurfaceMesh
from warp_mca.system.workspace import ROWS

if TYPE_CHECKING:
    from warp_mca.step.solver import Solver
    from warp_mca.system.state import State


class NodalStress:
    """Stress at some nodes: the elements around them, and what each node gathers.

    Attributes:
        tensor: stress [Pa], shape (node_count,), vec6 of float32.
        von_mises: [Pa], shape (node_count,), float32.
        plastic: equivalent plastic strain [-], shape (node_count,), float32.
    """

    def __init__(self, solver: Solver, nodes: NDArray[np.int32]) -> None:
        model = solver.model
        local = np.full(model.node_count, -1, dtype=np.int32)
        local[nodes] = np.arange(len(nodes))
        self.solver, self.parts = solver, []
        corner, first = [], 0
        for stage in solver.elements:
            element = np.flatnonzero((local[stage.block.conn] >= 0).any(axis=0)).astype(np.int32)
            if len(element):
                self.parts.append((stage, wp.array(element, dtype=wp.int32), first))
            corner.append(local[stage.block.conn[:, element]].T.ravel())
            first += stage.corners * len(element)
        flat = np.concatenate([np.zeros(0, np.int32), *corner])
        slot = np.argsort(flat, kind="stable")[np.count_nonzero(flat < 0) :]
        offset = np.searchsorted(flat[slot], np.arange(len(nodes) + 1))
        self.offset = wp.array(offset, dtype=wp.int32)
        self.slot = wp.array(slot, dtype=wp.int32)
        self.points = wp.zeros((7, first), dtype=wp.float32)
        self.tensor = wp.zeros(len(nodes), dtype=output.vec6)
        self.von_mises = wp.zeros(len(nodes), dtype=wp.float32)
        self.plastic = wp.zeros(len(nodes), dtype=wp.float32)

    def launch(self, state: State) -> None:
        """Compute it for the state's displacements."""
        self.find_corners(state, state.u)
        self.gather()

    def find_corners(self, state: State, u: wp.array) -> None:
        """Stress at the corners of elements with displacements u [m]."""
        for stage, element, first in self.parts:
            stage.stresses(self.solver.work, state, u, element, first, self.points)
            if failing := state.elements[stage.index].failing:
                inputs = [failing.age, element, stage.corners, first]
                wp.launch(output.leave_out_failed, len(element), inputs=inputs, outputs=[self.points])

    def gather(self) -> None:
        """Their means at nodes."""
        outputs = [self.tensor, self.von_mises, self.plastic]
        kernel = output.stress_of_whole if self.solver.model.fails else output.nodal_stress
        wp.launch(kernel, len(self.tensor), inputs=[self.offset, self.slot, self.points], outputs=outputs)


class Output:
    """What a run shows of its state.

    Attributes:
        arrays: device arrays that a frame copies, by need and name.
        path_stress: ring of probe stresses [Pa], shape (ROWS, probe_count), vec6 of float32.
    """

    def __init__(self, solver: Solver, skins: Mapping[str, SurfaceMesh], probes: Probes, needs: frozenset[str]) -> None:
        self.solver, self.needs = solver, needs
        self.has_probes = len(probes.corner) > 0
        self.arrays: dict[str, dict[str, wp.array]] = {}
        with wp.ScopedDevice(solver.device):
            if self.has_probes:
                self._make_probes(probes)
            if SURFACE in needs:
                self._make_skin(np.concatenate([skin.nodes for skin in skins.values()]))
            if CONTACT in needs:
                count = sum(len(stage.slave) for stage in solver.contacts)
                if solver.model.fails:  # whatever comes to the surface
                    count = solver.model.node_count * 2 * len(solver.contacts)
                self.arrays[CONTACT] = {
                    "points": wp.zeros(count, dtype=wp.vec3f),
                    "state": wp.zeros(count, dtype=wp.int32),
                }
            if VOLUME in needs:
                self._make_volume()
            if solver.model.fails:
                self.failed = wp.zeros(solver.model.element_count, dtype=wp.int32)
                for need in needs & {SURFACE, VOLUME}:
                    self.arrays[need]["failed"] = self.failed

    def _make_probes(self, probes: Probes) -> None:
        nodes, local = np.unique(probes.corner, return_inverse=True)
        self.probe_stress = NodalStress(self.solver, nodes.astype(np.int32))
        self.probe_corner = wp.array(local.reshape(probes.corner.shape), dtype=wp.int32)
        self.probe_weight = wp.array(probes.weight, dtype=wp.float32)
        self.path_stress = wp.zeros((ROWS, len(probes.corner)), dtype=output.vec6)
        self.arrays[PATHS] = {"von_mises": wp.zeros(len(probes.corner), dtype=wp.float32)}

    def _make_skin(self, nodes: NDArray[np.int32]) -> None:
        self.skin_node = wp.array(nodes, dtype=wp.int32)
        self.skin_stress = NodalStress(self.solver, nodes)
        self.arrays[SURFACE] = {
            "points": wp.zeros(len(nodes), dtype=wp.vec3f),
            "von_mises": self.skin_stress.von_mises,
            "plastic_strain": self.skin_stress.plastic,
        }

    def _make_volume(self) -> None:
        count = self.solver.model.node_count
        self.volume_stress = NodalStress(self.solver, np.arange(count, dtype=np.int32))
        self.arrays[VOLUME] = {
            "displacement": wp.zeros(count, dtype=wp.vec3f),
            "velocity": wp.zeros(count, dtype=wp.vec3f),
            "stress": self.volume_stress.tensor,
            "von_mises": self.volume_stress.von_mises,
            "plastic_strain": self.volume_stress.plastic,
        }

    def before_step(self, state: State, needs: frozenset[str]) -> None:
        """Launch what is read off the state at t(n), after its forces are known: probes, and a frame of `needs`."""
        work, u = self.solver.work, self.solver.work.at_record(state)
        for stage in self.solver.elements if needs & {SURFACE, VOLUME} else ():
            if failing := state.elements[stage.index].failing:
                wp.launch(output.mark_failed, stage.count, [failing.age, stage.block.first], [self.failed])
        for stress in self._stresses(needs):
            stress.find_corners(state, u)
        if SURFACE in needs:
            points = self.arrays[SURFACE]["points"]
            wp.launch(output.positions, len(points), inputs=[work.X, u, self.skin_node], outputs=[points])
        if VOLUME in needs:
            to = self.arrays[VOLUME]["displacement"]
            wp.launch(output.displacements, len(to), inputs=[u], outputs=[to])

    def nodal_stress(self, needs: frozenset[str]) -> None:
        """Launch what follows from stresses at corners, whatever the state is by then."""
        for stress in self._stresses(needs):
            stress.gather()
        if self.has_probes:
            inputs = [self.probe_corner, self.probe_weight, self.probe_stress.tensor, self.solver.work.row]
            outputs = [self.path_stress, self.arrays[PATHS]["von_mises"]]
            wp.launch(output.sample_probes, len(self.probe_corner), inputs=inputs, outputs=outputs)

    def _stresses(self, needs: frozenset[str]) -> list[NodalStress]:
        """Of probes, and those that a frame needs."""
        found = [self.probe_stress] if self.has_probes else []
        found += [self.skin_stress] if SURFACE in needs else []
        return found + ([self.volume_stress] if VOLUME in needs else [])

    def contact_points(self, state: State, needs: frozenset[str]) -> None:
        """Launch what is read off springs, once contact is computed and before nodes move."""
        first = 0
        if CONTACT in needs and self.solver.model.fails:
            self.arrays[CONTACT]["state"].zero_()
        for stage in self.solver.contacts if CONTACT in needs else []:
            inputs = [self.solver.work.X, state.u, stage.slave, stage.mu, stage.sides, first]
            inputs.append(state.contacts[stage.index].spring)
            outputs = list(self.arrays[CONTACT].values())
            wp.launch(output.contact_points, len(stage.slave), inputs=inputs, outputs=outputs)
            first += len(stage.slave)

    def after_step(self, state: State, needs: frozenset[str]) -> None:
        """Launch what needs the velocities on both sides of t(n)."""
        if VOLUME in needs:
            to = self.arrays[VOLUME]["velocity"]
            inputs = [self.solver.work.v_before, state.v]
            wp.launch(output.velocities, len(to), inputs=inputs, outputs=[to])
