"""Owns at which sizes of cells the meshes of a scene are alike, so that their figures make one series.

Counts of cells are whole: two cells through a thickness are still two with `refine` 1.2, and the cells along a bar
smaller. Figures of such meshes do not go as h^p. Levels are therefore taken where all counts are nearly multiples of
the scene's, and what they are in truth is their mean.
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

FEW = 16  # counts above it are nearly multiples at every level [-]
APART = 1.4  # least ratio of two levels of a series [-]
FAR = 0.5  # what a level may be from where it is wanted, over what counts may be from multiples, in logarithms [-]
ANOTHER = 1.15  # least ratio of two levels as meshed, for their meshes to tell how figures go [-]
ALIKE = 0.12  # by which counts of a mesh like the scene's differ from multiples, in logarithms [-]
FINEST = 8.0  # level at which counts are told from other whole numbers of a recipe [-]


@dataclass(frozen=True)
class Levels:
    """Meshes of a scene by their refine over a base.

    Attributes:
        scene: whose bodies are refined.
        base: refine at level 1 [-].
    """

    scene: Scene
    base: float
    _known: dict[float, list[int]] = field(default_factory=dict, init=False, repr=False, compare=False)

    def near(self, wanted: float, least: float, most: float, coarser: float | None = None) -> float:
        """The level from `least` to `most` that is like the base and near a wanted one; both weigh.

        Its mesh is another one than that of the level `coarser`; where all are the same, it is the first above.
        """
        beyond = 0.0 if coarser is None else ANOTHER * self.meshed(coarser)
        levels = (wanted, *self._whole)
        found = [level for level in levels if least <= level <= most and self.meshed(level) >= beyond]
        if not found:
            found = [next((level for level in self._whole if level > most and self.meshed(level) >= beyond), wanted)]
        return min(found, key=lambda level: self.unlike(level) + FAR * abs(math.log(level / wanted)))

    def finer(self, than: float, step: float, most: float) -> list[float]:
        """Levels above one, from one to the next about a step, up to the greatest; those like the base, if any are."""
        found, wanted = list[float](), APART * than
        while wanted <= most * (1.0 + 1e-9):
            found.append(self.near(wanted, wanted, min(step * wanted, most), coarser=than))
            wanted = step * found[-1]
        return [level for level in found if self.unlike(level) <= ALIKE] or found

    def unlike(self, level: float) -> float:
        """By how much counts differ from multiples of the base's at most, as a logarithm [-]."""
        return max((abs(math.log(ratio / level)) for ratio in self._ratios(level)), default=0.0)

    def meshed(self, level: float) -> float:
        """The level as it is meshed: the mean of its counts over those of the base [-]."""
        ratios = self._ratios(level)
        return math.exp(sum(map(math.log, ratios)) / len(ratios)) if ratios else level

    @cached_property
    def _whole(self) -> list[float]:
        """Levels at which a small count of the base is a whole number of cells."""
        small = {base for base, finest in zip(*self._ends, strict=True) if 0 < base != finest and base <= FEW}
        return sorted({k / count for count in small for k in range(1, math.ceil(FINEST * count) + 1)})

    @cached_property
    def _ends(self) -> tuple[list[int], list[int]]:
        """Whole numbers of the base, and of a much finer mesh: those that differ are counts of cells."""
        base, finest = self._numbers(1.0), self._numbers(FINEST)
        return (base, finest) if len(base) == len(finest) else ([], [])

    def _ratios(self, level: float) -> list[float]:
        if level not in self._known:
            self._known[level] = self._numbers(level)
        (base, finest), found = self._ends, self._known[level]
        if len(found) != len(base):  # a recipe whose numbers come and go
            return []
        return [n / b for b, f, n in zip(base, finest, found, strict=True) if 0 < b != f and n > 0]

    def _numbers(self, level: float) -> list[int]:
        """Whole numbers of all recipes at a level; none where a recipe has no such level."""
        try:
            recipes = [refined(body.name, body.geometry, self.base * level) for body in self.scene.bodies]
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
