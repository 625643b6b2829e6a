"""Owns flow that stiffens with its rate: sigma_s(p) (1 + (rate / D)^(1 / q)), the static stress by a table.

Cowper and Symonds, Brown University Applied Mathematics Report 28 (1957). The rate is that of the equivalent plastic
strain in the step, dp / dt.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.materials import radial, table
from warp_mca.kernels.materials.exponential import power_function

wp.set_module_options({"enable_backward": False})

D, ROOT, COUNT = 3, 4, 5  # columns of `Model.law`: D [1/s], 1 / q [-], the table
HISTORY = radial.HISTORY

parameters = table.parameters


@cache
def rate_factor(precision: str) -> Any:
    """As `kernels.materials.radial` asks."""
    R, Table, power = scalars(precision).real, table.table_type(precision), power_function(precision)

    @wp.func
    def cowper_symonds_rate(dp: R, dt: R, c: Table):
        root = c.law[c.row, wp.static(ROOT)]
        over = power(dp / (dt * c.law[c.row, wp.static(D)]), root)
        return R(1.0) + over, root * over / dp

    return cowper_symonds_rate


@cache
def flow(precision: str) -> Any:
    """The radial return."""
    kind, hardening = table.table_type(precision), table.hardening(precision, COUNT)
    return radial.rated_return(precision, kind, hardening, rate_factor(precision))


@cache
def plastic_work(precision: str) -> Any:
    """Of the history."""
    return radial.kept_work(precision, table.table_type(precision))
