"""Owns the list of kernels that a solver's steps need, to be compiled and loaded before graphs are captured."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import warp as wp

from warp_mca.kernels.contact import contact
from warp_mca.kernels.hardware import subnormals
from warp_mca.kernels.nodes import slide
from warp_mca.kernels.records import output
from warp_mca.physics.elements.stage import BLOCK_DIM as ELEMENT_BLOCK
from warp_mca.physics.joints import coupling_stage

if TYPE_CHECKING:
    from warp_mca.step.solver import Solver


def kernels_of(solver: Solver) -> list[tuple[list[Any], int | None]]:
    """One of each module with the threads of its blocks, None for Warp's own number: it is compiled for one."""
    stress = bool(solver.output and solver.output.arrays)
    sums = solver.records.kernels() + solver.loads.kernels() + solver.absorbing.record_kernels()
    sums += solver.rigid.kernels() + solver.sensors.kernels()
    sums += [slide.slide] if len(solver.constraints.rails) else []
    sums += [output.nodal_stress] if stress else []
    sums += [] if wp.get_device().is_cuda else [subnormals.begin_flush]
    movers = (solver.nodes, solver.absorbing, solver.ties, solver.floating)
    nodes = [kernel for stage in movers for kernel in stage.kernels()]
    elements = [kernel for stage in (*solver.elements, *solver.sensors.layers) for kernel in stage.kernels()]
    elements += [stage.stress_kernel for stage in solver.elements if stress]
    return [
        (sums + [kernel for stage in solver.contacts for kernel in stage.search_kernels()], None),
        (nodes + elements, ELEMENT_BLOCK),
        *([solver.resident.kernels()] if solver.resident else []),
        (solver.couplings.kernels(), coupling_stage.BLOCK),
        ([kernel for stage in solver.contacts for kernel in stage.kernels()], contact.BLOCK_DIM),
    ]
