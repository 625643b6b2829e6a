"""Owns our own claims: what has a limit as meshes are refined, with stiff springs and hinges as built."""

from __future__ import annotations

from collections.abc import Callable

from warp_mca.paper import readings as read
from warp_mca.paper import word_checks as check
from warp_mca.paper.claims import Claim
from warp_mca.results.result import Result

_ROWS = (  # what of a run with stiff springs and hinges as built has a limit, and the change that counts as none
    ("peak", "first peak", read.first_peak, 0.01),
    ("second", "second peak", read.second_peak, 0.03),
    ("impulse", "impulse of F_n", read.impulse, 0.01),
    ("contact", "duration of contact", read.duration, 0.01),
)


def _limit(key: str, what: str, reading: Callable[[Result], float], least: float) -> Claim:
    said = f"with stiff springs and hinges of fork and eye the mesh changes the {what} by less than {100 * least:g} %"
    share = f"< {100 * least:g} %"
    reason = "coarse meshes change it by more"
    return Claim(f"limit_{key}", "(ours)", said, share, check.finest_meshes("limit", reading, least), reason=reason)


LIMITS: tuple[Claim, ...] = tuple(_limit(*row) for row in _ROWS)
