"""Owns what a CPU makes of numbers too small to have all their digits: zeros, while it computes steps.

Ahead of a wave float32 leaves such numbers, on which x86-64 is ten times slower; a GPU takes them for zero as well.
"""

import warp as wp

wp.set_module_options({"enable_backward": False})

# Bits of x86-64's MXCSR: results that are subnormal become zero, and so do operands. Each thread has its own.
_SET = """
#if defined(__x86_64__) && !defined(__CUDA_ARCH__)
    unsigned before = __builtin_ia32_stmxcsr();
    __builtin_ia32_ldmxcsr(flush ? before | 0x8040u : before & ~0x8040u);
    return (before & 0x8040u) == 0x8040u;
#else
    return flush;
#endif
"""


@wp.func_native(_SET)
def set_flush(flush: wp.bool) -> wp.bool:
    """Whether the present thread takes subnormal numbers for zero from now on; returns whether it did."""
    ...


@wp.kernel(enable_backward=False, grid_stride=False)
def begin_flush(before_out: wp.array(dtype=wp.bool)):
    """Subnormal numbers are zero in this thread."""
    before_out[0] = set_flush(True)


@wp.kernel(enable_backward=False, grid_stride=False)
def end_flush(before: wp.array(dtype=wp.bool), flushed_out: wp.array(dtype=wp.bool)):
    """They are what they were before `begin_flush`; whether they were zero until now."""
    flushed_out[0] = set_flush(before[0])
