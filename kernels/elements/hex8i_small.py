"""Owns the stress of `hex8i` at small strain: in closed form while it is elastic, else a loop over its points."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.internal_modes import FOUR_THIRDS, LEAST, PLANE, layers, mode_functions, place_functions
from warp_mca.kernels.hardware.scalars import THIRD, scalars
from warp_mca.kernels.materials.flow import flow_function, history_functions

wp.set_module_options({"enable_backward": False})


@cache
def internal_function(precision: str) -> Any:
    """The function (D, y_k, plastic, K, G) -> internal vector with which the traction along n_k vanishes.

    D is twice the strain that is linear in a natural coordinate. `plastic` is twice the part of the plastic strain that
    is linear in it, 6 sum_g w_g xi_k eps_p, times y_k; weights w have the sum 1.
    """
    t = scalars(precision)
    R, vec3 = t.real, t.vec3
    tensor = wp.types.vector(6, R)
    modes = mode_functions(precision)
    product, solve = modes.product, modes.solve

    @wp.func
    def internal_vector(D: tensor, y: vec3, plastic: vec3, K: R, G: R):
        # The traction of the pressure, along y, apart: in `solve` it would leave a small difference of large numbers.
        lame = R(0.5) * K - R(THIRD) * G  # of twice the strain
        share = lame / wp.max(K + R(FOUR_THIRDS) * G, R(LEAST)) * (D[0] + D[1] + D[2]) / wp.dot(y, y)
        return -share * y - solve(G * (product(D, y) - plastic), y, K, G)

    return internal_vector


@cache
def stress_modes_function(precision: str) -> Any:
    """The function (x, H, q, y, n0, n1, n2, K, G) -> elastic stress over the element, by the way in which it varies.

    (Deviators of the mean, linear in each coordinate, and product of the two others; pressures of the mean and linear
    in each coordinate.) n_k are what `internal_function` calls `plastic`.
    """
    t = scalars(precision)
    R, vec3, mat33, mat43, mat73 = t.real, t.vec3, t.mat33, t.mat43, t.mat73
    tensor = wp.types.vector(6, R)
    modes = mode_functions(precision)
    doubled, normals, deviator, twice = modes.doubled, modes.normals, modes.deviator, modes.twice
    internal_vector, doubled_gradient = internal_function(precision), modes.doubled_gradient

    @wp.func
    def pressure_of(D: tensor, K: R):
        return R(0.5) * K * (D[0] + D[1] + D[2])

    @wp.func
    def stress_modes(x: mat73, H: mat33, q: mat43, y: mat33, n0: vec3, n1: vec3, n2: vec3, K: R, G: R):
        D0, D1, D2 = doubled(q, y)
        D0 = D0 + twice(internal_vector(D0, y[0], n0, K, G), y[0])
        D1 = D1 + twice(internal_vector(D1, y[1], n1, K, G), y[1])
        D2 = D2 + twice(internal_vector(D2, y[2], n2, K, G), y[2])
        D = doubled_gradient(H)
        z = G * normals(q, x)
        return (
            G * deviator(D),
            G * deviator(D0),
            G * deviator(D1),
            G * deviator(D2),
            z[0] * deviator(twice(y[0], y[0])),
            z[1] * deviator(twice(y[1], y[1])),
            z[2] * deviator(twice(y[2], y[2])),
            pressure_of(D, K),
            vec3(pressure_of(D0, K), pressure_of(D1, K), pressure_of(D2, K)),
        )

    return stress_modes


@cache
def conjugate_function(precision: str) -> Any:
    """The function (x, volume, y, S0, S1, S2, p, w) -> forces conjugate to the hourglass amplitudes [N].

    S_k + p_k I are the parts of the stress that are linear in coordinate k, w_k = n_k . N_k n_k / 64 of the parts N_k
    that are linear in the two others, each times the mean square of what it goes with.
    """
    t = scalars(precision)
    R, vec3, mat33, mat43, mat73 = t.real, t.vec3, t.mat33, t.mat43, t.mat73
    tensor = wp.types.vector(6, R)
    product = mode_functions(precision).product

    @wp.func
    def traction(S: tensor, p: R, y: vec3):
        return product(S, y) + p * y

    @wp.func
    def conjugate(x: mat73, volume: R, y: mat33, S0: tensor, S1: tensor, S2: tensor, p: vec3, w: vec3):
        Q = mat43()
        Q[0] = volume * (traction(S1, p[1], y[2]) + traction(S2, p[2], y[1]))
        Q[1] = volume * (traction(S0, p[0], y[2]) + traction(S2, p[2], y[0]))
        Q[2] = volume * (traction(S0, p[0], y[1]) + traction(S1, p[1], y[0]))
        Q[3] = volume * (w[0] * x[0] + w[1] * x[1] + w[2] * x[2])
        return Q

    return conjugate


@cache
def settled_function(precision: str) -> Any:
    """The function (S, p, y_k, K, G) -> S, p less the stress of an elastic strain s y_k that takes all their traction.

    S + p I is the part of the stress that is linear in coordinate k. So the forces are conjugate to the closed form of
    the internal vectors. The third value is 3 t . s of the traction t: in the next step the vector changes by -3 s, and
    t does so much work, per volume, that no force does.
    """
    R, vec3, tensor = scalars(precision).real, scalars(precision).vec3, wp.types.vector(6, scalars(precision).real)
    modes = mode_functions(precision)
    product, solve, twice = modes.product, modes.solve, modes.twice

    @wp.func
    def settled(S: tensor, p: R, y: vec3, K: R, G: R):
        t = product(S, y) + p * y
        s = solve(t, y, K, G)
        D = twice(s, y)
        return S - G * D, p - (R(0.5) * K - R(THIRD) * G) * (D[0] + D[1] + D[2]), R(3.0) * wp.dot(t, s)

    return settled


@cache
def elastic_function(precision: str, points: int) -> Any:
    """The function (x, volume, H, q, y, K, G) -> (mean stress P, hourglass forces Q, greatest S : S / 2 of a point)."""
    t = scalars(precision)
    R, vec3, mat33, mat43, mat73 = t.real, t.vec3, t.mat33, t.mat43, t.mat73
    tensor = wp.types.vector(6, R)
    modes, stress_modes, conjugate = (
        mode_functions(precision),
        stress_modes_function(precision),
        conjugate_function(precision),
    )
    invariant, product, whole = modes.invariant, modes.product, modes.whole
    outermost = max(layers(points)[0])

    @wp.func
    def greatest(S: tensor, S0: tensor, S1: tensor, S2: tensor, N0: tensor, N1: tensor, N2: tensor):
        """Over the outermost points, where coordinates are +-1."""
        largest = R(0.0)
        for i in range(2):
            s = R(2 * i - 1)
            a = S + s * S0
            b = S1 + s * N2
            c = S2 + s * N1
            for j in range(2):
                r = R(2 * j - 1)
                mean = a + r * b
                slope = c + r * N0
                largest = wp.max(largest, wp.max(invariant(mean - slope), invariant(mean + slope)))
        return largest

    @wp.func
    def elastic_stress(x: mat73, volume: R, H: mat33, q: mat43, y: mat33, K: R, G: R):
        none = vec3()
        S, S0, S1, S2, N0, N1, N2, pressure, p = stress_modes(x, H, q, y, none, none, none, K, G)
        third = R(THIRD)
        w = vec3(wp.dot(y[0], product(N0, y[0])), wp.dot(y[1], product(N1, y[1])), wp.dot(y[2], product(N2, y[2])))
        Q = conjugate(x, third * volume, y, S0, S1, S2, p, third * w)
        r = R(PLANE)
        outer = R(wp.static(outermost))
        largest = greatest(S, r * S0, r * S1, outer * S2, (r * outer) * N0, (r * outer) * N1, third * N2)
        return whole(S, pressure), Q, largest

    return elastic_stress


@cache
def stress_function(precision: str, law_name: str, points: int) -> Any:
    """The function that gives mean stress P, hourglass forces Q, greatest elastic S : S / 2 and whether points flow.

    The last value is the energy that the lag of the internal vectors takes [J], if points flow. All points take the
    return map of the law. The internal vectors come before, with the plastic strain of the step before: in closed form,
    and the forces lag by one step's flow.
    """
    t = scalars(precision)
    R, vec3, mat33, mat43, mat73 = t.real, t.vec3, t.mat33, t.mat43, t.mat73
    tensor = wp.types.vector(6, R)
    modes, stress_modes, conjugate = (
        mode_functions(precision),
        stress_modes_function(precision),
        conjugate_function(precision),
    )
    invariant, product, whole = modes.invariant, modes.product, modes.whole
    flow_at = flow_function(precision, law_name, points)
    plastic_tractions = plastic_tractions_function(precision, law_name, points)
    column_place, layer_place, layer_count = *place_functions(precision, points), points // 4
    settled = settled_function(precision)

    @wp.func
    def tensor_of(S: mat33):
        return tensor(S[0, 0], S[1, 1], S[2, 2], S[0, 1], S[1, 2], S[0, 2])

    @wp.func
    def flow_stress(
        x: mat73,
        volume: R,
        H: mat33,
        q: mat43,
        y: mat33,
        K: R,
        G: R,
        e: int,
        m: int,
        flag: int,
        law: wp.array2d(dtype=R),
        history_out: wp.array2d(dtype=R),
    ):
        flows = bool(False)
        n0, n1, n2 = plastic_tractions(y, e, history_out)
        S, S0, S1, S2, N0, N1, N2, pressure, p = stress_modes(x, H, q, y, n0, n1, n2, K, G)
        mean = tensor()
        R0 = tensor()
        R1 = tensor()
        R2 = tensor()
        M0 = tensor()
        M1 = tensor()
        M2 = tensor()
        largest = R(0.0)
        for column in range(4):
            xi, eta = column_place(column)
            middle = (S + xi * S0) + eta * (S1 + xi * N2)
            slope = (S2 + xi * N1) + eta * N0
            total = tensor()
            moment = tensor()
            for k in range(wp.static(layer_count)):
                zeta, share = layer_place(k)
                T = middle + zeta * slope
                largest = wp.max(largest, invariant(T))
                g = wp.static(layer_count) * column + k
                flowing, dp = flow_at(whole(T, R(0.0)), G, g, e, m, flag, law, history_out)
                if dp > R(0.0):
                    flows = bool(True)
                total = total + share * tensor_of(flowing)
                moment = moment + (share * zeta) * tensor_of(flowing)
            mean = mean + total
            R0 = R0 + xi * total
            R1 = R1 + eta * total
            R2 = R2 + moment
            M0 = M0 + eta * moment
            M1 = M1 + xi * moment
            M2 = M2 + (xi * eta) * total
        w = vec3(wp.dot(y[0], product(M0, y[0])), wp.dot(y[1], product(M1, y[1])), wp.dot(y[2], product(M2, y[2])))
        p = R(THIRD) * p
        R0, p0, work0 = settled(R0, p[0], y[0], K, G)
        R1, p1, work1 = settled(R1, p[1], y[1], K, G)
        R2, p2, work2 = settled(R2, p[2], y[2], K, G)
        Q = conjugate(x, volume, y, R0, R1, R2, vec3(p0, p1, p2), w)
        return whole(mean, pressure), Q, largest, flows, volume * (work0 + work1 + work2)

    return flow_stress


@cache
def plastic_tractions_function(precision: str, law_name: str, points: int) -> Any:
    """The function (y, e, history) -> 6 sum_g w_g xi_k eps_p y_k of the kept plastic strain, for k = 0 to 2."""
    t = scalars(precision)
    R, mat33, tensor = t.real, t.mat33, wp.types.vector(6, t.real)
    read_history, _ = history_functions(precision, law_name, points)
    product = mode_functions(precision).product
    column_place, layer_place, layer_count = *place_functions(precision, points), points // 4

    @wp.func
    def plastic_tractions(y: mat33, e: int, history: wp.array2d(dtype=R)):
        m0 = tensor()
        m1 = tensor()
        m2 = tensor()
        for column in range(4):
            xi, eta = column_place(column)
            total = tensor()
            for k in range(wp.static(layer_count)):
                zeta, share = layer_place(k)
                h = read_history(history, wp.static(layer_count) * column + k, e)
                strain = tensor(h[0], h[1], -h[0] - h[1], h[2], h[3], h[4])
                total = total + share * strain
                m2 = m2 + (share * zeta) * strain
            m0 = m0 + xi * total
            m1 = m1 + eta * total
        six = R(6.0)
        return six * product(m0, y[0]), six * product(m1, y[1]), six * product(m2, y[2])

    return plastic_tractions
