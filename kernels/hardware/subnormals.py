"""Owns the treatment of subnormal numbers on a CPU: they are zero while steps are computed.

Ahead of a wave float32 leaves such numbers, with which x86-64 is many times slower. GPU kernels that use fast math
flush them to zero as well.
"""

import warp as wp

# Of x86-64's MXCSR, which each thread has to itself: results that are subnormal become zero, and so do operands.
_FLUSH = "0x8040u"


def _exchange(wanted: str) -> str:
    return f"""
    #if defined(__x86_64__) && !defined(__CUDA_ARCH__)
        unsigned before = __builtin_ia32_stmxcsr();
        __builtin_ia32_ldmxcsr({wanted});
        return before;
    #else
        return 0;
    #endif
    """


@wp.func_native(_exchange(f"before | {_FLUSH}"))
def flush() -> wp.uint32:
    """Flush subnormal numbers to zero in this thread from now on. Returns the previous mode."""
    ...


@wp.func_native(_exchange("mode"))
def set_mode(mode: wp.uint32) -> wp.uint32:
    """Set the mode of this thread. Returns the previous mode."""
    ...
