"""Owns the loading of kernels, and their compilation where Warp has not kept them: on a GPU side by side."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import warp as wp

from warp_mca.kernels.contact import crossing
from warp_mca.kernels.hardware import thread_pool
from warp_mca.system.threads import thread_count

Job = tuple[int | None, Any]  # threads of a block, for which a module is compiled, and the module
ON_CPU: tuple[Any, Any] = thread_pool.lead, crossing.edges_inside  # kernels of a run there, and beside a GPU


def load_modules(device: str, jobs: Sequence[Job]) -> None:
    """Load what a step needs on a device, and what a CPU needs beside it.

    Warp compiles one module for a CPU at a time, so that a GPU's are compiled beside them.
    """
    if not wp.get_device(device).is_cuda:
        for size, module in [(None, ON_CPU[0].module), *jobs]:
            wp.force_load(device, [module], block_dim=size)
        return
    with ThreadPoolExecutor(thread_count(None)) as threads:
        found = [threads.submit(wp.force_load, "cpu", [ON_CPU[1].module])]
        found += [threads.submit(wp.force_load, device, [module], block_dim=size) for size, module in jobs]
        for one in found:
            one.result()
