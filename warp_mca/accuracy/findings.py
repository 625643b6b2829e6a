"""Owns `TradeOff`, what a trade-off found: variants, their errors against the reference, and the frontier."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from warp_mca.accuracy.figures import BOUND, NAMES, errors, worst
from warp_mca.accuracy.knobs import Trial
from warp_mca.accuracy.measure import Measured
from warp_mca.accuracy.reference import Reference


@dataclass(frozen=True, kw_only=True)
class TradeOff:
    """What a trade-off found.

    Attributes:
        scene: its name.
        device, threads: that variants ran on, the device with its name.
        duration: of the impact phase [s].
        budget: that was asked for [s], or None.
        clock: of `Measured.wall`, that variants are compared by, see `Bench.clock`.
        reference: what they are compared with.
        variants: as measured, in the order of the runs; the first is the scene as written.
        left_out: variants that the budget had no time for, and the time foreseen for each [s].
        same: variants that were not run because their meshes are those of another one, and that one.
        spent: by all runs [s].
    """

    scene: str
    device: str
    threads: int | None
    duration: float
    budget: float | None
    clock: str
    reference: Reference
    variants: Sequence[Measured]
    left_out: Sequence[tuple[Trial, float]] = ()
    same: Sequence[tuple[Trial, Trial]] = ()
    spent: float = 0.0

    @property
    def base(self) -> Measured:
        """The scene as written."""
        return self.variants[0]

    def errors_of(self, found: Measured) -> dict[str, float | None]:
        """Share by which each figure of a variant differs from the reference [-]."""
        return errors(found.figures, self.reference.figures)

    def time_of(self, found: Measured) -> float:
        """What a variant took [s]."""
        return found.wall[self.clock]

    def frontier(self, figure: str | None = None) -> list[Measured]:
        """Variants that no other beats in both time and error, by rising time.

        Args:
            figure: whose error counts; the greatest of those that an asked accuracy binds if None.
        """
        rows = []
        for found in self.variants:
            shares = {} if found.stopped else self.errors_of(found)
            error = _bound(shares) if figure is None else shares.get(figure)
            if error is not None:
                rows.append((self.time_of(found), abs(error), found))
        best: list[Measured] = []
        least = float("inf")
        for _, error, found in sorted(rows, key=lambda row: row[:2]):
            if error < least:
                best.append(found)
                least = error
        return best


def _bound(shares: Mapping[str, float | None]) -> float | None:
    """Greatest error of the figures that an asked accuracy binds [-]; None where there are none of these."""
    known = {name: share for name, share in shares.items() if name in BOUND and share is not None}
    return worst({name: known.get(name) for name in NAMES}) if known else None
