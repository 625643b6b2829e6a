"""Owns isotropic hardening by a table: straight lines between its points, the last stress beyond them.

A row of `Model.law` has the number n of points in a column, behind it n plastic strains, from 0 on, then n stresses.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.materials.radial import isotropic_return

wp.set_module_options({"enable_backward": False})

COUNT = 3  # column of the number of points


@cache
def table_type(precision: str) -> Any:
    """A row of `Model.law`, whose stresses are multiplied by `scale`."""
    R = scalars(precision).real

    @wp.struct
    class Table:
        law: wp.array2d(dtype=R)
        row: int
        scale: R

    return Table


@cache
def parameters(precision: str) -> Any:
    """The function (law, m, scale) -> table of row m of `Model.law`."""
    R, Table = scalars(precision).real, table_type(precision)

    @wp.func
    def table_parameters(law: wp.array2d(dtype=R), m: int, scale: R):
        c = Table()
        c.law = law
        c.row = m
        c.scale = scale
        return c

    return table_parameters


@cache
def curve_function(precision: str, column: int) -> Any:
    """The function (p, c) -> (stress [Pa], slope [Pa], integral up to p [J/m^3]) of the table from this column on."""
    R, Table = scalars(precision).real, table_type(precision)

    @wp.func
    def curve(p: R, c: Table):
        m = c.row
        count = int(c.law[m, wp.static(column)])
        first = wp.static(column + 1)
        work = R(0.0)
        at = c.law[m, first]
        stress = c.law[m, first + count]
        slope = R(0.0)
        for i in range(1, count):
            length = c.law[m, first + i] - at
            rise = c.law[m, first + count + i] - stress
            if p < at + length:
                slope = rise / length
                break
            work += length * (stress + R(0.5) * rise)
            at += length
            stress += rise
        beyond = p - at
        work += beyond * (stress + R(0.5) * slope * beyond)
        return c.scale * (stress + slope * beyond), c.scale * slope, c.scale * work

    return curve


@cache
def hardening(precision: str, column: int = COUNT) -> Any:
    """As `kernels.materials.radial` asks, of the table from this column on."""
    R, Table, curve = scalars(precision).real, table_type(precision), curve_function(precision, column)

    @wp.func
    def table_hardening(p: R, c: Table):
        stress, slope, _work = curve(p, c)
        return stress, slope

    return table_hardening


@cache
def return_map(precision: str) -> Any:
    """The radial return."""
    return isotropic_return(precision, table_type(precision), hardening(precision))


@cache
def plastic_energy(precision: str) -> Any:
    """The function (eps_p, p, c) -> plastic work per volume [J/m^3], the integral of the flow stress over p."""
    t = scalars(precision)
    R, mat33, Table, curve = t.real, t.mat33, table_type(precision), curve_function(precision, COUNT)

    @wp.func
    def table_energy(eps_p: mat33, p: R, c: Table):
        _stress, _slope, work = curve(p, c)
        return work

    return table_energy
