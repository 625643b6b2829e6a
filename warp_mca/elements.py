"""Owns the former name of `warp_mca.physics.elements`, under which elements from outside the package import it."""

import sys

from warp_mca.physics import elements
from warp_mca.physics.elements import stage

sys.modules[__name__] = elements
sys.modules[f"{__name__}.stage"] = stage
