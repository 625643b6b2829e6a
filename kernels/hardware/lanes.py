"""Owns how a CPU computes several elements at once: the loop over the threads of a launch, in vector registers.

Generated source holds no other `for`. Each thread of these kernels writes to entries of its own and reads none that
another writes, so that the compiler needs no proof that their arrays lie apart. It gives up where a vector of three is
stored in one piece, and then leaves the loop as it is.
"""

import re
from typing import Any

import warp as wp

LANES = 64  # ranges begin at multiples, so that the same elements are left over whichever way the whole is cut

_LARGEST = 60_000  # by LLVM's count; `hex8` at finite strain costs 47,000, Warp sets 9,000

_PREAMBLE = """
#pragma clang diagnostic ignored "-Wpass-failed"
#define for _Pragma("clang loop vectorize(assume_safety) vectorize_width(8) interleave(disable)") for
"""


def side_by_side(kernel: Any, large: bool = False) -> Any:
    """The kernel, whose module on the CPU computes as many threads at once as a register holds.

    One that is `large` would stay a call, which ends that: the compiler is told to make it part of the loop.
    """
    options: dict[str, object] = {"extra_build_options": wp.ModuleBuildOptions(extra_cpu_preamble=_PREAMBLE)}
    flags = wp.config.cpu_compiler_flags
    if large and flags:
        options["cpu_compiler_flags"] = re.sub(r"(-inline-threshold=)\d+", rf"\g<1>{_LARGEST}", flags)
    wp.set_module_options(options, module=kernel.module)
    return kernel
