"""Owns the barriers between blocks of threads that are on the device together, which count the arrivals.

None of it runs on a CPU.
"""

from typing import Any

import warp as wp

# Entries of the counts, each in a line of the cache of its own: blocks whose forces are stored, blocks whose nodes have
# moved, blocks that have ended.
FORCES, NODES, ENDED = 0, 32, 64
COUNTS = 96

TOGETHER: set[str] = set()  # keys of kernels whose blocks of threads wait for each other


def together(kernel: Any) -> Any:
    """Register a kernel whose blocks of threads must all be on the device at once."""
    TOGETHER.add(kernel.key)
    return kernel


@wp.func_native("""
    __syncthreads();
    if (threadIdx.x == 0)
        asm volatile("red.release.gpu.global.add.u32 [%0], 1;" :: "l"(&count_out.data[entry]) : "memory");
""")
def arrive(entry: int, count_out: wp.array(dtype=wp.int32)):
    """Count this block of threads. Those who wait for it see everything that it wrote."""
    ...


@wp.func_native("""
    if (threadIdx.x == 0) {
        int seen;
        do {
            asm volatile("ld.acquire.gpu.global.u32 %0, [%1];" : "=r"(seen) : "l"(&count.data[entry]) : "memory");
        } while (seen < goal);
    }
    __syncthreads();
""")
def wait_for(entry: int, goal: int, count: wp.array(dtype=wp.int32)):
    """Wait until so many blocks of threads have been counted."""
    ...


@wp.func_native(f"""
    __syncthreads();
    if (threadIdx.x == 0 && atomicInc((unsigned*)&count_out.data[{ENDED}], gridDim.x - 1) == gridDim.x - 1) {{
        count_out.data[{FORCES}] = 0;
        count_out.data[{NODES}] = 0;
    }}
""")
def leave(count_out: wp.array(dtype=wp.int32)):
    """The last block of threads to leave clears the counts for the next launch."""
    ...
