"""Owns sums over time of what acts at t(n): half a step before it, half a step after it."""

from typing import Any

import warp as wp


@wp.func
def add_half_steps(k: int, before: Any, after: Any, sum_out: wp.array(dtype=Any), after_out: wp.array(dtype=Any)):
    """Add `before` and `after`, the parts on either side of t(n), to entry k of a sum.

    sum_out is the sum up to t(n), which `before` completes; after_out holds the sum half a step later, which the next
    step continues.
    """
    total = after_out[k] + before
    sum_out[k] = total
    after_out[k] = total + after
