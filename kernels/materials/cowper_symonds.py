"""Owns flow that stiffens with its rate: sigma_s(p) (1 + (rate / D)^(1 / q)), the static stress by a table.

Cowper and Symonds, Brown University Applied Mathematics Report 28 (1957). The rate is that of the equivalent plastic
strain in the step, dp / dt.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.materials import radial, table

wp.set_module_options({"enable_backward": False})

D, ROOT, COUNT = 3, 4, 5  # columns of `Model.law`: D [1/s], 1 / q [-], the table
HISTORY = radial.HISTORY

parameters = table.parameters


@cache
def strength(precision: str) -> Any:
    """As `kernels.materials.radial` asks."""
    R, Table, curve = scalars(precision).real, table.table_type(precision), table.curve_function(precision, COUNT)

    @wp.func
    def rated_stress(p: R, dp: R, dt: R, c: Table):
        static, slope, _work = curve(p, c)
        root = c.law[c.row, wp.static(ROOT)]
        over = wp.pow(dp / (dt * c.law[c.row, wp.static(D)]), root)
        return static * (R(1.0) + over), slope * (R(1.0) + over) + static * root * over / dp

    return rated_stress


@cache
def flow(precision: str) -> Any:
    """The radial return."""
    return radial.rated_return(precision, strength(precision), table.table_type(precision))


@cache
def plastic_work(precision: str) -> Any:
    """Of the history."""
    return radial.kept_work(precision, table.table_type(precision))
