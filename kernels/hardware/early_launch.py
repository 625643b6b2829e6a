"""Owns programmatic dependent launch: a kernel of a captured graph begins while the one before it ends.

CUDA C++ Programming Guide, "Programmatic Dependent Launch and Synchronization". The kernel starts when every block of
the one before it has called `let_next_begin` or has ended. Before `wait_for_previous` it may read only what no such
kernel writes; after that call all writes of the kernel before it are visible. Both functions do nothing on a CPU, and
in graphs whose edges were not changed (`warp_mca.step.early_launch`).
"""

from typing import Any

import warp as wp

MIN_ARCH = 90  # compute capability times ten of the first devices that support it

EARLY: set[str] = set()  # keys of kernels that wait
LEADING: set[str] = set()  # keys of other kernels, for whose end waiting kernels may wait


def begins_early(kernel: Any) -> Any:
    """Register a kernel whose threads wait before they write, and before they read what such kernels write."""
    EARLY.add(kernel.key)
    return kernel


def lets_begin(kernel: Any) -> Any:
    """Register a kernel that begins after its predecessors: its waiting blocks would occupy the GPU for long."""
    LEADING.add(kernel.key)
    return kernel


def _on_gpu(instruction: str) -> str:
    return f"""
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= {10 * MIN_ARCH}
asm volatile("{instruction};" ::: "memory");
#endif
"""


@wp.func_native(_on_gpu("griddepcontrol.wait"))
def wait_for_previous():
    """Wait until the kernel before this one has ended."""
    ...


@wp.func_native(_on_gpu("griddepcontrol.launch_dependents"))
def let_next_begin():
    """Let the next kernel begin once all blocks of this one have called this."""
    ...
