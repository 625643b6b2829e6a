"""Owns the vectorisation of element kernels on a CPU: the compiler turns the loop over threads into SIMD instructions.

The pragma below applies to every `for` of a module; the source that Warp generates for these kernels holds only the
loop over threads. Each thread writes to entries of its own and reads none that another thread writes, so that the
compiler need not prove that arrays do not overlap. It does not vectorise a loop that stores a vector of three in one
piece; kernels therefore store forces by components.
"""

import re
from typing import Any

import warp as wp

RANGE_MULTIPLE = 64  # ranges of threads begin at multiples of it: results do not depend on how elements are divided

_INLINE_THRESHOLD = 300_000  # cost by LLVM's count; `hex8` at finite strain costs 47,000, Warp's own limit is 9,000
_ACCESSES = 10_000  # to memory in a loop; above 100, LLVM does not see that the number of threads stays the same

_PREAMBLE = """
#pragma clang diagnostic ignored "-Wpass-failed"
#define for _Pragma("clang loop vectorize(assume_safety) vectorize_width(8) interleave(disable)") for
"""
_BUILD = wp.ModuleBuildOptions(extra_cpu_preamble=_PREAMBLE)


def vectorised(kernel: Any, large: bool = False) -> Any:
    """The kernel, with options of its module that vectorise it on the CPU.

    A `large` kernel would remain a function call, or a loop of unknown length, which prevents vectorisation: limits are
    raised for it.
    """
    options: dict[str, object] = {"extra_build_options": _BUILD}
    flags = wp.config.cpu_compiler_flags
    if large and flags:
        raised = re.sub(r"(-inline-threshold=)\d+", rf"\g<1>{_INLINE_THRESHOLD}", flags)
        options["cpu_compiler_flags"] = f"{raised} -mllvm=-memssa-check-limit={_ACCESSES}"
    known = kernel.module.options
    if any(known.get(name) != value for name, value in options.items()):  # Warp hashes a module anew that was set
        wp.set_module_options(options, module=kernel.module)
    return kernel
