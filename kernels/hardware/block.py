"""Owns what the threads of a block do together, and their indices; on a CPU a block is one thread."""

from typing import Any

import warp as wp


@wp.func
def block_sum(x: Any):
    """Sum of what each thread of the block found, in a fixed order; all threads call this and get the sum."""
    found = wp.tile_sum(wp.tile(x, preserve_type=True))
    return found[0]


@wp.func_native("""
#if defined(__CUDA_ARCH__)
__syncthreads();
#endif
""")
def wait_for_block():
    """Wait for all threads of the block."""
    ...


@wp.func
def from_start(i: int):
    """The same index, known not to be negative: Warp checks others for counting from the end."""
    return i & 0x7FFFFFFF
