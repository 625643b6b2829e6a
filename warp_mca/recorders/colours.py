"""Owns the colours of stress: one palette for rerun, USD and figures, and the scale from stress to colour.

The palette is viridis, which is perceptually uniform, grows lighter from end to end (so that it prints in grey) and is
read alike with every common colour blindness. It is tabulated at 33 of its 256 entries and interpolated: no entry is
off by more than 2 of 255 from matplotlib's, which need not be imported.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import bad_value
from warp_mca.base.validate import brief, is_number
from warp_mca.scene import Scene
from warp_mca.scene.materials import Material

STICK, SLIP = 0xF0E442FF, 0xD55E00FF  # contact points, as 0xRRGGBBAA: Okabe and Ito's yellow and vermilion
_NODES = """
    440154 470d60 48186a 482374 472d7b 453781 424086 3e4989 3b528b 375b8d 33638d
    2f6b8e 2c728e 297a8e 26828e 23898e 21918c 1f978b 1f9f88 21a685 27ad81 31b57b
    3dbc74 4cc26c 5cc863 6ece58 81d34d 95d840 aadc32 c0df25 d5e21a eae51a fde725
""".split()


def _tabulated() -> NDArray[np.uint8]:
    node = np.array([[int(text[k : k + 2], 16) for k in (0, 2, 4)] for text in _NODES], dtype=float)
    at = np.round(np.linspace(0.0, 255.0, len(node)))
    channels = [np.interp(np.arange(256), at, node[:, k]) for k in range(3)]
    return np.round(np.stack(channels, axis=1)).astype(np.uint8)


PALETTE: NDArray[np.uint8] = _tabulated()  # red, green, blue of each level, shape (256, 3)
_PACKED = (PALETTE.astype(np.uint32) @ np.array([1 << 24, 1 << 16, 1 << 8], dtype=np.uint32)) | np.uint32(0xFF)


def levels(value: NDArray[np.floating], limit: float) -> NDArray[np.uint8]:
    """Nearest palette entry of each value, 255 sqrt(value / limit): 255 at `limit` and above, 0 for nan.

    The root spreads small values: waves of a few MPa show beside a contact of some hundred.

    Args:
        value: not below 0, any shape, such as von Mises stress [Pa].
        limit: of the scale, in the unit of `value`.
    """
    share = value * (1.0 / limit if limit > 0.0 else 0.0)
    return (255.0 * np.sqrt(np.fmin(np.fmax(share, 0.0), 1.0)) + 0.5).astype(np.uint8)  # these leave out nan


def stress_at(share: float, limit: float) -> float:
    """Value at a share of the palette's length, 0 to 1: the inverse of `levels`."""
    return limit * share**2


def packed(value: NDArray[np.floating], limit: float) -> NDArray[np.uint32]:
    """Opaque colour of each value as 0xRRGGBBAA, uint32, the shape of `value`; see `levels`."""
    return _PACKED[levels(value, limit)]


def check_limit(limit: float | None) -> None:
    """Check the stress at the upper end of the palette [Pa].

    Raises:
        RequestError: it is neither None nor a finite number above 0.
    """
    if limit is not None and not (is_number(limit) and limit > 0.0):
        raise bad_value("limit", brief(limit), "give the stress at the upper end of the colours, above 0 Pa")


class ColourScale:
    """The stress at the upper end of the palette: fixed, or the greatest seen so far.

    Attributes:
        limit: stress at the upper end [Pa]; 0 until a running scale has seen some.
        fixed: whether it stays as it is.
        origin: where a fixed limit comes from, in words.
    """

    def __init__(self, scene: Scene, limit: float | None = None) -> None:
        """Take `limit` [Pa]; without it, the lowest yield stress of the scene, or a running maximum if nothing yields.

        Raises:
            RequestError: `limit` is not a finite number above 0.
        """
        check_limit(limit)
        lowest = min((m.yield_stress for m in _materials(scene)), default=math.inf)
        yields = math.isfinite(lowest)
        self.fixed = limit is not None or yields
        self.limit = limit if limit is not None else lowest if yields else 0.0
        self.origin = "as asked" if limit is not None else "yield stress" if yields else "greatest so far"

    def include(self, greatest: float) -> bool:
        """Let a running scale grow to `greatest` [Pa]; whether the limit changed."""
        if self.fixed or not greatest > self.limit:
            return False
        self.limit = greatest
        return True

    @property
    def label(self) -> str:
        """What the legend says: quantity, unit, and how the limit came about."""
        kind = "fixed" if self.fixed else "running maximum"
        return f"von Mises stress [MPa], square-root scale, {kind} ({self.origin})"


def _materials(scene: Scene) -> list[Material]:
    found: list[Material] = []
    for body in scene.bodies:
        found += [body.material] if not hasattr(body.material, "values") else list(body.material.values())  # pyright: ignore
    return found
