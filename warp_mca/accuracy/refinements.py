"""Owns at which sizes of cells the meshes of a scene are alike, so that their figures make one series.

Counts of cells are whole: two cells through a thickness are still two with `refine` 1.2, and the cells along a bar
smaller. Figures of such meshes do not converge as h^p. Refinements are therefore chosen so that all counts of cells are
nearly multiples of the scene's; the refinement as meshed is the mean of their ratios.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, fields, is_dataclass
from functools import cached_property
from typing import Any

from warp_mca.base.errors import RequestError
from warp_mca.geometry.refinement import refined
from warp_mca.scene import Scene

FEW = 16  # counts above this are nearly multiples at every refinement [-]
APART = 1.4  # least ratio of two refinements of a series [-]
FAR = 0.5  # weight of the distance from a wanted refinement over that of counts from multiples, in logarithms [-]
ANOTHER = 1.15  # least ratio of two refinements as meshed from which convergence can be judged [-]
ALIKE = 0.12  # largest distance of counts from multiples in a mesh like the scene's, in logarithms [-]
FINEST = 8.0  # refinement at which counts are told from other whole numbers of a recipe [-]


@dataclass(frozen=True)
class Refinements:
    """Meshes of a scene by their refine over a base.

    Attributes:
        scene: whose bodies are refined.
        base: `refine` at which the refinement is 1 [-].
    """

    scene: Scene
    base: float
    _known: dict[float, list[int]] = field(default_factory=dict, init=False, repr=False, compare=False)

    def near(self, wanted: float, least: float, most: float, coarser: float | None = None) -> float:
        """The refinement from `least` to `most` that best combines being like the base and near the wanted one.

        Its mesh differs from that of the refinement `coarser`; if none does, it is the first refinement above `most`.
        """
        beyond = 0.0 if coarser is None else ANOTHER * self.meshed(coarser)
        refinements = (wanted, *self._whole)
        found = [r for r in refinements if least <= r <= most and self.meshed(r) >= beyond]
        if not found:
            found = [next((r for r in self._whole if r > most and self.meshed(r) >= beyond), wanted)]
        return min(found, key=lambda r: self.unlike(r) + FAR * abs(math.log(r / wanted)))

    def finer(self, than: float, step: float, most: float) -> list[float]:
        """Refinements above `than`, about `step` apart, up to `most`; only those like the base, if any are."""
        found, wanted = list[float](), APART * than
        while wanted <= most * (1.0 + 1e-9):
            found.append(self.near(wanted, wanted, min(step * wanted, most), coarser=than))
            wanted = step * found[-1]
        return [r for r in found if self.unlike(r) <= ALIKE] or found

    def unlike(self, refinement: float) -> float:
        """By how much counts differ from multiples of the base's at most, as a logarithm [-]."""
        return max((abs(math.log(ratio / refinement)) for ratio in self._ratios(refinement)), default=0.0)

    def meshed(self, refinement: float) -> float:
        """The refinement as it is meshed: the mean of its counts over those of the base [-]."""
        ratios = self._ratios(refinement)
        return math.exp(sum(map(math.log, ratios)) / len(ratios)) if ratios else refinement

    @cached_property
    def _whole(self) -> list[float]:
        """Refinements at which a small count of the base is a whole number of cells."""
        small = {base for base, finest in zip(*self._ends, strict=True) if 0 < base != finest and base <= FEW}
        return sorted({k / count for count in small for k in range(1, math.ceil(FINEST * count) + 1)})

    @cached_property
    def _ends(self) -> tuple[list[int], list[int]]:
        """Whole numbers of the base, and of a much finer mesh: those that differ are counts of cells."""
        base, finest = self._numbers(1.0), self._numbers(FINEST)
        return (base, finest) if len(base) == len(finest) else ([], [])

    def _ratios(self, refinement: float) -> list[float]:
        if refinement not in self._known:
            self._known[refinement] = self._numbers(refinement)
        (base, finest), found = self._ends, self._known[refinement]
        if len(found) != len(base):  # a recipe whose numbers come and go
            return []
        return [n / b for b, f, n in zip(base, finest, found, strict=True) if 0 < b != f and n > 0]

    def _numbers(self, refinement: float) -> list[int]:
        """Whole numbers of all recipes at a refinement; none where a recipe has no such refinement."""
        try:
            recipes = [refined(body.name, body.geometry, self.base * refinement) for body in self.scene.bodies]
        except RequestError:
            return []
        return [number for recipe in recipes for number in _whole_numbers(recipe)]


def _whole_numbers(recipe: Any) -> Iterator[int]:
    """Whole numbers of a recipe and of those within it, in the order of their fields."""
    if isinstance(recipe, int) and not isinstance(recipe, bool):
        yield recipe
    elif isinstance(recipe, tuple | list):
        for item in recipe:
            yield from _whole_numbers(item)
    elif is_dataclass(recipe):
        for item in fields(recipe):
            yield from _whole_numbers(getattr(recipe, item.name))
