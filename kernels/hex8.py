"""Owns the fully integrated hexahedron: co-rotational total form, sum-factorised, mean dilatation.

The element's rotation Q is taken out first; small strain is measured in the rotated frame from reference
coordinates, so that nothing drifts however many steps are run. Gradients come from edge vectors interpolated along
one direction at a time and the cofactors of the Jacobian; forces go back by the transposed pass.
Mean dilatation: Hughes, Int. J. Numer. Meth. Engng 15 (1980) 1413.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels import j2
from warp_mca.kernels.rotation import nearest_rotation
from warp_mca.kernels.scalars import scalars

wp.set_module_options({"enable_backward": False})

_GAUSS = 0.5773502691896257
_THIRD = 1.0 / 3.0
_NEAR, _FAR = 0.5 * (1.0 + _GAUSS), 0.5 * (1.0 - _GAUSS)


@cache
def edge_functions(precision: str) -> tuple[Any, Any]:
    """Functions (half edge vectors along a direction, interpolation of four edge vectors to the four Gauss lines)."""
    t = scalars(precision)
    R, mat43, mat83 = t.real, t.mat43, t.mat83

    @wp.func
    def half_edges(x: mat83, direction: int):
        e = mat43()
        if direction == 0:
            e[0] = R(0.5) * (x[1] - x[0])
            e[1] = R(0.5) * (x[2] - x[3])
            e[2] = R(0.5) * (x[5] - x[4])
            e[3] = R(0.5) * (x[6] - x[7])
        if direction == 1:
            e[0] = R(0.5) * (x[3] - x[0])
            e[1] = R(0.5) * (x[2] - x[1])
            e[2] = R(0.5) * (x[7] - x[4])
            e[3] = R(0.5) * (x[6] - x[5])
        if direction == 2:
            e[0] = R(0.5) * (x[4] - x[0])
            e[1] = R(0.5) * (x[5] - x[1])
            e[2] = R(0.5) * (x[7] - x[3])
            e[3] = R(0.5) * (x[6] - x[2])
        return e

    @wp.func
    def to_gauss(e: mat43):
        near = R(_NEAR)
        far = R(_FAR)
        f = mat43()
        f[0] = near * e[0] + far * e[1]
        f[1] = near * e[1] + far * e[0]
        f[2] = near * e[2] + far * e[3]
        f[3] = near * e[3] + far * e[2]
        g = mat43()
        g[0] = near * f[0] + far * f[2]
        g[2] = near * f[2] + far * f[0]
        g[1] = near * f[1] + far * f[3]
        g[3] = near * f[3] + far * f[1]
        return g

    return half_edges, to_gauss


@cache
def frame_functions(precision: str) -> tuple[Any, Any]:
    """Functions that take an element to its rotated frame: (rotation as W = Q - I, local displacements)."""
    t = scalars(precision)
    R, mat33, mat83 = t.real, t.mat33, t.mat83
    half_edges, _ = edge_functions(precision)
    polar_rotation = nearest_rotation(precision)

    @wp.func
    def mean_edge(x: mat83, direction: int):
        e = half_edges(x, direction)
        return R(0.25) * (e[0] + e[1] + e[2] + e[3])

    @wp.func
    def element_rotation(X: mat83, u: mat83):
        c0 = mean_edge(X, 0)
        c1 = mean_edge(X, 1)
        c2 = mean_edge(X, 2)
        a0 = wp.cross(c1, c2)
        a1 = wp.cross(c2, c0)
        a2 = wp.cross(c0, c1)
        inverse = R(1.0) / wp.dot(c0, a0)
        grad = wp.outer(mean_edge(u, 0), a0) + wp.outer(mean_edge(u, 1), a1) + wp.outer(mean_edge(u, 2), a2)
        return polar_rotation(wp.identity(n=3, dtype=R) + inverse * grad)

    @wp.func
    def local_displacement(X: mat83, u: mat83, W: mat33):
        Wt = wp.transpose(W)
        local = mat83()
        for a in range(8):
            local[a] = u[a] + Wt * (X[a] + u[a])  # Q^T (X + u) - X, without the digits that would cancel
        return local

    return element_rotation, local_displacement


@cache
def gradient_function(precision: str) -> Any:
    """The function that gives Jacobian determinant and displacement gradient at Gauss point g = i + 2 j + 4 k."""
    t = scalars(precision)
    mat43 = t.mat43

    @wp.func
    def point_gradient(gx: mat43, gy: mat43, gz: mat43, lx: mat43, ly: mat43, lz: mat43, g: int):
        i = g & 1
        j = (g >> 1) & 1
        k = g >> 2
        jx = j + 2 * k
        jy = i + 2 * k
        jz = i + 2 * j
        b0 = wp.cross(gy[jy], gz[jz])
        b1 = wp.cross(gz[jz], gx[jx])
        b2 = wp.cross(gx[jx], gy[jy])
        det = wp.dot(gx[jx], b0)
        return det, (wp.outer(lx[jx], b0) + wp.outer(ly[jy], b1) + wp.outer(lz[jz], b2)) / det

    return point_gradient


@cache
def node_force_function(precision: str) -> Any:
    """The function that turns edge forces, one 4 x 3 matrix for each direction, into the node forces of an element."""
    t = scalars(precision)
    mat43, mat83 = t.mat43, t.mat83

    @wp.func
    def edge_to_node(Fx: mat43, Fy: mat43, Fz: mat43):
        f = mat83()
        f[0] = Fx[0] + Fy[0] + Fz[0]
        f[1] = Fy[1] + Fz[1] - Fx[0]
        f[2] = Fz[3] - Fx[1] - Fy[1]
        f[3] = Fx[1] - Fy[0] + Fz[2]
        f[4] = Fx[2] + Fy[2] - Fz[0]
        f[5] = Fy[3] - Fx[2] - Fz[1]
        f[6] = -Fx[3] - Fy[3] - Fz[3]
        f[7] = Fx[3] - Fy[2] - Fz[2]
        return f

    return edge_to_node


@cache
def load_function(precision: str) -> Any:
    """The function that reads an element's nodes relative to its first one, differenced before they are rounded."""
    t = scalars(precision)
    R, vec3, mat83 = t.real, t.vec3, t.mat83

    @wp.func
    def load_element(field: wp.array(dtype=wp.vec3d), conn: wp.array2d(dtype=wp.int32), e: int):
        local = mat83()
        origin = field[conn[0, e]]
        for a in range(1, 8):
            d = field[conn[a, e]] - origin
            local[a] = vec3(R(d[0]), R(d[1]), R(d[2]))
        return local

    return load_element


@cache
def history_functions(precision: str) -> tuple[Any, Any]:
    """Functions that read and write the J2 history of one integration point."""
    t = scalars(precision)
    R, mat33 = t.real, t.mat33

    @wp.func
    def read_plastic_strain(history: wp.array2d(dtype=R), point: int, e: int):
        k = point * wp.static(j2.HISTORY_SIZE)
        xx = history[k, e]
        yy = history[k + 1, e]
        xy = history[k + 2, e]
        yz = history[k + 3, e]
        xz = history[k + 4, e]
        return mat33(xx, xy, xz, xy, yy, yz, xz, yz, -xx - yy), history[k + 5, e]

    @wp.func
    def write_plastic_strain(history_out: wp.array2d(dtype=R), point: int, e: int, eps_p: mat33, p: R):
        k = point * wp.static(j2.HISTORY_SIZE)
        history_out[k, e] = eps_p[0, 0]
        history_out[k + 1, e] = eps_p[1, 1]
        history_out[k + 2, e] = eps_p[0, 1]
        history_out[k + 3, e] = eps_p[1, 2]
        history_out[k + 4, e] = eps_p[0, 2]
        history_out[k + 5, e] = p

    return read_plastic_strain, write_plastic_strain


@cache
def force_kernel(precision: str, plastic: bool) -> Any:
    """Kernel: forces of each element on its nodes, and the plastic history where `plastic`."""
    t = scalars(precision)
    R, vec3, mat33, mat43 = t.real, t.vec3, t.mat33, t.mat43
    half_edges, to_gauss = edge_functions(precision)
    element_rotation, local_displacement = frame_functions(precision)
    edge_to_node = node_force_function(precision)
    load_element = load_function(precision)
    read_plastic_strain, write_plastic_strain = history_functions(precision)
    j2_return = j2.return_map(precision)

    @wp.kernel(enable_backward=False, module="unique")
    def hex8_force(
        X: wp.array(dtype=wp.vec3d),
        conn: wp.array2d(dtype=wp.int32),
        material: wp.array(dtype=wp.int32),
        law: wp.array2d(dtype=R),
        u: wp.array(dtype=wp.vec3d),
        slot: int,
        yielded_out: wp.array(dtype=wp.int32),
        history_out: wp.array2d(dtype=R),
        force_out: wp.array(dtype=vec3),
    ):
        e = wp.tid()
        Xl = load_element(X, conn, e)
        ul = load_element(u, conn, e)
        W = element_rotation(Xl, ul)
        ul = local_displacement(Xl, ul, W)
        gx = to_gauss(half_edges(Xl, 0))
        gy = to_gauss(half_edges(Xl, 1))
        gz = to_gauss(half_edges(Xl, 2))
        lx = to_gauss(half_edges(ul, 0))
        ly = to_gauss(half_edges(ul, 1))
        lz = to_gauss(half_edges(ul, 2))
        m = material[e]
        K = law[m, 0]
        G = law[m, 1]
        flag = int(0)
        if wp.static(plastic):
            flag = yielded_out[e]
        flag_new = flag
        Sx = mat43()  # stress times cofactor, summed over the two points of each Gauss line
        Sy = mat43()
        Sz = mat43()
        Bx = mat43()  # cofactors alone, which carry the element's one pressure
        By = mat43()
        Bz = mat43()
        volume = R(0.0)
        dilation = R(0.0)
        for g in range(8):
            i = g & 1
            j = (g >> 1) & 1
            k = g >> 2
            jx = j + 2 * k
            jy = i + 2 * k
            jz = i + 2 * j
            b0 = wp.cross(gy[jy], gz[jz])
            b1 = wp.cross(gz[jz], gx[jx])
            b2 = wp.cross(gx[jx], gy[jy])
            det = wp.dot(gx[jx], b0)
            grad = wp.outer(lx[jx], b0) + wp.outer(ly[jy], b1) + wp.outer(lz[jz], b2)
            trace = wp.trace(grad)
            volume += det
            dilation += trace
            # written out: one division, and no product with the zeros of an identity (16 % of this kernel's time)
            inverse = R(1.0) / det
            mean = R(_THIRD) * inverse * trace
            xy = R(0.5) * inverse * (grad[0, 1] + grad[1, 0])
            yz = R(0.5) * inverse * (grad[1, 2] + grad[2, 1])
            xz = R(0.5) * inverse * (grad[0, 2] + grad[2, 0])
            xx = inverse * grad[0, 0] - mean
            yy = inverse * grad[1, 1] - mean
            zz = inverse * grad[2, 2] - mean
            strain = mat33(xx, xy, xz, xy, yy, yz, xz, yz, zz)
            S = R(2.0) * G * strain
            if wp.static(plastic):
                eps_p = mat33()
                p = R(0.0)
                if flag != 0:
                    eps_p, p = read_plastic_strain(history_out, g, e)
                S, eps_new, p_new = j2_return(strain, eps_p, p, G, law[m, 2], law[m, 3], law[m, 4])
                if p_new > p:
                    write_plastic_strain(history_out, g, e, eps_new, p_new)
                    flag_new = int(1)
            Sx[jx] = Sx[jx] + S * b0
            Sy[jy] = Sy[jy] + S * b1
            Sz[jz] = Sz[jz] + S * b2
            Bx[jx] = Bx[jx] + b0
            By[jy] = By[jy] + b1
            Bz[jz] = Bz[jz] + b2
        if wp.static(plastic):
            if flag_new != flag:
                yielded_out[e] = flag_new
        pressure = K * dilation / volume
        half = R(0.5)
        Fx = to_gauss(half * (Sx + pressure * Bx))
        Fy = to_gauss(half * (Sy + pressure * By))
        Fz = to_gauss(half * (Sz + pressure * Bz))
        f = edge_to_node(Fx, Fy, Fz)
        count = conn.shape[1]
        for a in range(8):
            force_out[slot + a * count + e] = f[a] + W * f[a]

    return hex8_force


@cache
def energy_kernel(precision: str, plastic: bool) -> Any:
    """Kernel: elastic and plastic energy [J], largest strain [-] and smallest Jacobian ratio of each element."""
    t = scalars(precision)
    R, mat33 = t.real, t.mat33
    half_edges, to_gauss = edge_functions(precision)
    element_rotation, local_displacement = frame_functions(precision)
    load_element = load_function(precision)
    point_gradient = gradient_function(precision)
    read_plastic_strain, _ = history_functions(precision)
    plastic_energy = j2.plastic_energy(precision)

    @wp.kernel(enable_backward=False, module="unique")
    def hex8_energy(
        X: wp.array(dtype=wp.vec3d),
        conn: wp.array2d(dtype=wp.int32),
        material: wp.array(dtype=wp.int32),
        law: wp.array2d(dtype=R),
        yielded: wp.array(dtype=wp.int32),
        history: wp.array2d(dtype=R),
        u: wp.array(dtype=wp.vec3d),
        first: int,
        energy_out: wp.array2d(dtype=R),
    ):
        e = wp.tid()
        Xl = load_element(X, conn, e)
        ul = load_element(u, conn, e)
        W = element_rotation(Xl, ul)
        ul = local_displacement(Xl, ul, W)
        gx = to_gauss(half_edges(Xl, 0))
        gy = to_gauss(half_edges(Xl, 1))
        gz = to_gauss(half_edges(Xl, 2))
        lx = to_gauss(half_edges(ul, 0))
        ly = to_gauss(half_edges(ul, 1))
        lz = to_gauss(half_edges(ul, 2))
        m = material[e]
        identity = wp.identity(n=3, dtype=R)
        volume = R(0.0)
        dilation = R(0.0)
        elastic = R(0.0)
        dissipated = R(0.0)
        largest = R(0.0)
        smallest = R(1.0)
        for g in range(8):
            det, grad = point_gradient(gx, gy, gz, lx, ly, lz, g)
            trace = wp.trace(grad)
            volume += det
            dilation += trace * det
            strain = R(0.5) * (grad + wp.transpose(grad)) - trace / R(3.0) * identity
            eps_p = mat33()
            if wp.static(plastic):
                if yielded[e] != 0:
                    eps_p, p = read_plastic_strain(history, g, e)
                    dissipated += det * plastic_energy(eps_p, p, law[m, 2], law[m, 3], law[m, 4])
            elastic += det * law[m, 1] * wp.ddot(strain - eps_p, strain - eps_p)
            largest = wp.max(largest, wp.sqrt(R(2.0) / R(3.0) * wp.ddot(strain, strain)))
            smallest = wp.min(smallest, wp.determinant(identity + grad))
        energy_out[0, first + e] = elastic + R(0.5) * law[m, 0] * dilation * dilation / volume
        energy_out[1, first + e] = dissipated
        energy_out[2, first + e] = largest
        # an inverted element's Q is a reflection, which would hide the inversion in its own frame
        energy_out[3, first + e] = smallest * wp.determinant(identity + W)

    return hex8_energy
