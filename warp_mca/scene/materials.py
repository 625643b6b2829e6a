"""Owns the table of materials: a new one names the module of its law, gives its parameters, and has a place here."""

from __future__ import annotations

from warp_mca.scene.elastic import Elastic, check_law
from warp_mca.scene.foams import CrushableFoam
from warp_mca.scene.metals import Chaboche, CowperSymonds, J2Bilinear, J2Table, J2Voce, JohnsonCook
from warp_mca.scene.rubbers import MooneyRivlin, NeoHookean, Ogden
from warp_mca.scene.viscoelastic import Prony

__all__ = ["MATERIALS", "Elastic", "J2Bilinear", "Material", "check_law"]

Material = Elastic  # for annotations: every material is elastic below yield

_METALS = (J2Bilinear, J2Voce, J2Table, CowperSymonds, JohnsonCook, Chaboche)
_SOFT = (NeoHookean, MooneyRivlin, Ogden, Prony, CrushableFoam)
MATERIALS: dict[str, type[Material]] = {kind.__name__: kind for kind in (Elastic, *_METALS, *_SOFT)}
