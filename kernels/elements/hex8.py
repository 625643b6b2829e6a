"""Owns the fully integrated hexahedron: 2 x 2 x 2 points, mean dilatation, total form in the element's rotated frame.

The element's rotation Q is taken out first; strain is measured in the rotated frame from reference coordinates, so
that nothing drifts however many steps are run.
Mean dilatation: Hughes, Int. J. Numer. Meth. Engng 15 (1980) 1413; at finite strain Simo, Taylor and Pister, Comput.
Meth. Appl. Mech. Engng 51 (1985) 177.
"""

from functools import cache, partial
from typing import Any

import warp as wp

from warp_mca.kernels.elements.failure import failure_kernel as failure_of
from warp_mca.kernels.elements.formulation import MEAN, Formulation
from warp_mca.kernels.elements.hex8_points import points_force_kernel
from warp_mca.kernels.elements.hex8_small import small_strain_function
from warp_mca.kernels.elements.hexahedron import (
    LINE_SCALE,
    framed_function,
    gauss_line_function,
    gradient_function,
    history_place,
    store_function,
)
from warp_mca.kernels.elements.readings import energy_kernel as energy_of
from warp_mca.kernels.elements.readings import stress_kernel as stress_of
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.materials.laws import law_functions
from warp_mca.kernels.records.extremes import keep_functions

wp.set_module_options({"enable_backward": False})


@cache
def force_kernel(precision: str, law_name: str, finite: bool = False, viscous: int = 0) -> Any:
    """Kernel: forces of each element on its nodes, and the plastic history where there is a law.

    Every plastic element takes the return map, which suits a CPU that computes several elements side by side; a GPU
    runs `kernels.elements.hex8_patch`.
    """
    if finite or law_functions(law_name, precision).by_points:
        return points_force_kernel(precision, law_name, finite, viscous)
    t = scalars(precision)
    R, vec3 = t.real, t.vec3
    load_in_frame = framed_function(precision)
    element_forces = small_strain_function(precision, law_name, viscous)
    store_force = store_function(precision)
    keep_strain, keep_volume, strain_square = keep_functions(R)
    scale = LINE_SCALE**3

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False, module_options={"fast_math": True})
    def hex8_force(
        X: wp.array(dtype=wp.vec3d),
        conn: wp.array2d(dtype=wp.int32),
        material: wp.array(dtype=wp.int32),
        law: wp.array2d(dtype=R),
        u: wp.array(dtype=wp.vec3d),
        slot: int,
        count: int,
        dt: R,
        yielded_out: wp.array(dtype=wp.int32),
        history_out: wp.array2d(dtype=R),
        extreme_out: wp.array2d(dtype=R),
        force_out: wp.array(dtype=vec3),
    ):
        e = wp.tid()
        Xl, ul, W, J = load_in_frame(X, u, conn, e)
        m = material[e]
        K = R(scale) * law[m, 0]
        G = R(scale) * law[m, 1]
        f, largest = element_forces(Xl, ul, W, K, G, e, m, law, dt, yielded_out, history_out, extreme_out)
        keep_strain(e, strain_square(largest, G), extreme_out)
        keep_volume(e, R(1.0) - J, extreme_out)
        for a in range(8):
            store_force(force_out, slot + a * count + e, f, a)

    return hex8_force


@cache
def formulation(precision: str, law_name: str, finite: bool) -> Formulation:
    """Its points, of which each shows its stress at the corner that lies nearest."""
    t = scalars(precision)
    mat33, mat43 = t.mat33, t.mat43
    gauss_lines = gauss_line_function(precision, scaled=True)
    load_in_frame = framed_function(precision, finite)
    point_gradient = gradient_function(precision)

    @wp.struct
    class Hex8:
        """Rotation W = Q - I; Gauss lines gx, gy, gz of the corners and lx, ly, lz of their local displacements."""

        W: mat33
        gx: mat43
        gy: mat43
        gz: mat43
        lx: mat43
        ly: mat43
        lz: mat43

    @wp.func
    def load_shape(X: wp.array(dtype=wp.vec3d), u: wp.array(dtype=wp.vec3d), conn: wp.array2d(dtype=wp.int32), e: int):
        shape = Hex8()
        Xl, ul, W, _J = load_in_frame(X, u, conn, e)
        shape.W = W
        gx, gy, gz = gauss_lines(Xl)
        lx, ly, lz = gauss_lines(ul)
        shape.gx = gx
        shape.gy = gy
        shape.gz = gz
        shape.lx = lx
        shape.ly = ly
        shape.lz = lz
        return shape

    @wp.func
    def gradient(shape: Hex8, g: int):
        return point_gradient(shape.gx, shape.gy, shape.gz, shape.lx, shape.ly, shape.lz, g)

    @wp.func
    def rotation(shape: Hex8):
        return shape.W

    @wp.func
    def corner_of(g: int, j: int):
        return g ^ ((g >> 1) & 1)  # corners run around the faces

    return Formulation("hex8", 8, 8, MEAN, Hex8, load_shape, gradient, rotation, 1, corner_of, place=history_place)


energy_kernel, stress_kernel = partial(energy_of, formulation), partial(stress_of, formulation)
failure_kernel = partial(failure_of, formulation)
