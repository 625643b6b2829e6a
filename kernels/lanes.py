"""Owns how a CPU computes several elements at once: the loop over the threads of a launch, in vector registers.

Generated source holds no other `for`. Each thread of these kernels writes to entries of its own and reads none that
another writes, so that the compiler needs no proof that their arrays lie apart. It gives up where a vector of three is
stored in one piece, and then leaves the loop as it is.
"""

from typing import Any

import warp as wp

LANES = 64  # ranges begin at multiples, so that the same elements are left over whichever way the whole is cut

_PREAMBLE = """
#pragma clang diagnostic ignored "-Wpass-failed"
#define for _Pragma("clang loop vectorize(assume_safety) vectorize_width(8) interleave(disable)") for
"""


def side_by_side(kernel: Any) -> Any:
    """The kernel, whose module on the CPU computes as many threads at once as a register holds."""
    options = wp.ModuleBuildOptions(extra_cpu_preamble=_PREAMBLE)
    wp.set_module_options({"extra_build_options": options}, module=kernel.module)
    return kernel
