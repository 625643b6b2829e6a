"""Owns thermal strains: what elements take of them, the work that they do, and the stress that they leave.

The force kernels add the pressure of a thermal strain e (`kernels.elements.viscosity`). With the volume strain v, tr of
the strain or ln J, an element of volume V has the energy K V (v - 3 e)^2 / 2, as `kernels.elements.readings` has it, so
that a change de does the work -3 K V (v - 3 e) de.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.viscosity import DILATATION, THERMAL
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.loads.amplitude import Tables, value_at

wp.set_module_options({"enable_backward": False})


@wp.struct
class Heated:
    """Heated elements of a block.

    Attributes:
        element: number in the block, shape (count,), int32.
        load: number of the thermal strain of each, shape (count,), int32.
        place: of each in what is kept of all blocks, shape (count,), int32.
        volume: [m^3], shape (count,), float64.
        strain: of each thermal strain at factor 1 [-], shape (load_count,), float64.
    """

    element: wp.array(dtype=wp.int32)
    load: wp.array(dtype=wp.int32)
    place: wp.array(dtype=wp.int32)
    volume: wp.array(dtype=wp.float64)
    strain: wp.array(dtype=wp.float64)


@wp.struct
class Kept:
    """What is kept of heated elements from step to step.

    Attributes:
        strain, before: in the latest step and the one before it [-], shape (count,), float64.
        stress: 3 K (v - 3 e) in the one before [Pa], shape (count,), float64.
        work: of the thermal strain up to then [J], shape (count,), float64.
        clock: steps taken [-], shape (count,), int32.
    """

    strain: wp.array(dtype=wp.float64)
    before: wp.array(dtype=wp.float64)
    stress: wp.array(dtype=wp.float64)
    work: wp.array(dtype=wp.float64)
    clock: wp.array(dtype=wp.int32)


@cache
def volume_strain_function(precision: str, finite: bool) -> Any:
    """The function (e, extreme) -> volume strain that the latest forces were those of [-], 0 before the first."""
    R = scalars(precision).real

    @wp.func
    def volume_strain(e: int, extreme: wp.array2d(dtype=R)):
        theta = wp.float64(extreme[DILATATION, e])
        if theta < wp.float64(-1.5):
            return wp.float64(0.0)
        if wp.static(finite):
            return wp.log(wp.float64(1.0) + theta)
        return theta

    return volume_strain


@cache
def heat_kernel(precision: str, finite: bool) -> Any:
    """Kernel: the thermal strain at t(n), and its work up to t(n-1); `start`: at t = 0, and nothing is kept."""
    R, volume_strain = scalars(precision).real, volume_strain_function(precision, finite)

    @wp.kernel(enable_backward=False, module="unique")
    def heat(
        heated: Heated,
        tables: Tables,
        material: wp.array(dtype=wp.int32),
        law: wp.array2d(dtype=R),
        dt: wp.float64,
        start: bool,
        extreme_out: wp.array2d(dtype=R),
        strain_out: wp.array(dtype=wp.float64),
        before_out: wp.array(dtype=wp.float64),
        stress_out: wp.array(dtype=wp.float64),
        work_out: wp.array(dtype=wp.float64),
        clock_out: wp.array(dtype=wp.int32),
    ):
        k = wp.tid()
        e = heated.element[k]
        p = heated.place[k]
        stiffness = wp.float64(3.0) * wp.float64(law[material[e], 0])
        now = heated.strain[heated.load[k]] * value_at(tables, heated.load[k], dt * wp.float64(clock_out[p]))
        if wp.static(finite):
            now = wp.log(wp.float64(1.0) + now)
        extreme_out[THERMAL, e] = R(stiffness * now)
        if start:
            return
        if clock_out[p] > 0:
            strain = strain_out[p]
            stress = stiffness * (volume_strain(e, extreme_out) - wp.float64(3.0) * strain)
            mean = wp.float64(0.5) * (stress_out[p] + stress)
            work_out[p] = work_out[p] - heated.volume[k] * mean * (strain - before_out[p])
            before_out[p] = strain
            stress_out[p] = stress
        strain_out[p] = now
        clock_out[p] = clock_out[p] + 1

    return heat


@cache
def work_kernel(precision: str, finite: bool) -> Any:
    """Kernel: work of the thermal strains up to t(n), once the forces there are known."""
    R, volume_strain = scalars(precision).real, volume_strain_function(precision, finite)

    @wp.kernel(enable_backward=False, module="unique")
    def thermal_work(
        heated: Heated,
        kept: Kept,
        material: wp.array(dtype=wp.int32),
        law: wp.array2d(dtype=R),
        extreme: wp.array2d(dtype=R),
        entry_out: wp.array(dtype=wp.float64),
    ):
        k = wp.tid()
        e = heated.element[k]
        p = heated.place[k]
        stiffness = wp.float64(3.0) * wp.float64(law[material[e], 0])
        stress = stiffness * (volume_strain(e, extreme) - wp.float64(3.0) * kept.strain[p])
        mean = wp.float64(0.5) * (kept.stress[p] + stress)
        entry_out[p] = kept.work[p] - heated.volume[k] * mean * (kept.strain[p] - kept.before[p])

    return thermal_work


@cache
def stress_kernel(precision: str, finite: bool) -> Any:
    """Kernel: stresses at corners of some elements, as `readings.stress_kernel` gives them, with the thermal one."""
    R = scalars(precision).real

    @wp.kernel(enable_backward=False, module="unique")
    def thermal_stress(
        element: wp.array(dtype=wp.int32),
        extreme: wp.array2d(dtype=R),
        first: int,
        corners: int,
        stress_out: wp.array2d(dtype=wp.float32),
    ):
        item = wp.tid()
        e = element[item]
        stress = extreme[THERMAL, e]
        if wp.static(finite):
            stress = stress / (R(1.0) + extreme[DILATATION, e])
        for a in range(corners):
            for i in range(3):
                slot = first + corners * item + a
                stress_out[i, slot] = stress_out[i, slot] - wp.float32(stress)

    return thermal_stress
