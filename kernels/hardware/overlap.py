"""Owns how a kernel of a captured graph begins while the one before it ends: programmatic dependent launch.

CUDA C++ Programming Guide, "Programmatic Dependent Launch and Synchronization". Such a kernel is launched when all
blocks of threads of the one before it have said so, or have ended; no other such kernel writes what it reads then. It
waits before it touches anything else, until all that the other wrote can be seen. Where a graph is not told of it
(`warp_mca.solve.early_launch`), and on a CPU, both functions do nothing.
"""

from typing import Any

import warp as wp

wp.set_module_options({"enable_backward": False})

MIN_ARCH = 90  # compute capability times ten of the first devices that support it

EARLY: set[str] = set()  # keys of kernels that wait


def begins_early(kernel: Any) -> Any:
    """The kernel, all of whose threads wait before they write, and before they read what such kernels write."""
    EARLY.add(kernel.key)
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
    """Let the kernel after this one begin, once all blocks of threads have said so."""
    ...
