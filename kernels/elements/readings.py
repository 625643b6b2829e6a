"""Owns the kernels that read elements of every formulation: energies, strains and Jacobians, stresses."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.formulation import (
    MEAN,
    NODAL,
    OWN,
    SPLIT,
    Maker,
    load_function,
    modulus_functions,
    parts_of,
)
from warp_mca.kernels.elements.viscosity import THERMAL
from warp_mca.kernels.hardware.scalars import THIRD, scalars
from warp_mca.kernels.materials.isochoric import law_kinematics
from warp_mca.kernels.materials.kinematics import kinematics
from warp_mca.kernels.materials.laws import law_functions
from warp_mca.kernels.records.extremes import (
    LAG_LOSS,
    PLASTIC_STRAIN,
    RECORDS,
    STRAIN_SQUARE,
    VOLUME_LOSS,
    VON_MISES,
    keep_peak,
)

wp.set_module_options({"enable_backward": False})


@cache
def shared_function(maker: Maker, precision: str, law_name: str, finite: bool, heated: bool = False) -> Any:
    """The function (struct, e, K, swelling, group, dilatation) -> what points share.

    (J - 1 and pressure [Pa] of the mean; pressure and its energy [J] of pressure nodes; 0 where there is none.) The
    energy is that of the volume strain less `swelling` where elements are `heated`. K is what goes with the mean.
    """
    form, _, _ = parts_of(maker, precision, law_name, finite)
    struct, gradient, points, corners = form.struct, form.gradient, form.points, form.corners
    k, R = kinematics(precision, finite), scalars(precision).real
    dilatation_of, pressure_of, volumetric_energy = k.dilatation, k.pressure, k.volumetric_energy
    mean, nodal, share = form.pressure in (MEAN, SPLIT), form.pressure == NODAL, 1.0 / corners
    _, elastic_dilatation = swelling_functions(precision, finite, heated)

    @wp.func
    def shared_by_points(
        shape: struct, e: int, K: R, swelling: R, group: wp.array2d(dtype=wp.int32), dilatation: wp.array(dtype=R)
    ):
        theta = R(0.0)
        pressure = R(0.0)
        energy = R(0.0)
        if wp.static(mean):
            volume = R(0.0)
            for g in range(wp.static(points)):
                weight, H = gradient(shape, g)
                volume += weight
                theta += dilatation_of(H) * weight
            theta = theta / volume
            pressure = pressure_of(K, theta)
        if wp.static(nodal):
            for a in range(wp.static(corners)):
                pressure += R(share) * pressure_of(K, dilatation[group[a, e]])
                energy += R(share) * volumetric_energy(K, elastic_dilatation(dilatation[group[a, e]], swelling))
            weight, H = gradient(shape, 0)
            energy = weight * energy
        return theta, pressure, energy

    return shared_by_points


@cache
def swelling_functions(precision: str, finite: bool, heated: bool) -> tuple[Any, Any]:
    """Functions (e, K, extreme) -> volume strain of a thermal strain; (J - 1, that) -> J - 1 without it [-]."""
    R = scalars(precision).real

    @wp.func
    def swelling_of(e: int, K: R, extreme: wp.array2d(dtype=R)):
        if wp.static(heated):
            return extreme[THERMAL, e] / K
        return R(0.0)

    @wp.func
    def elastic_dilatation(theta: R, swelling: R):
        if wp.static(not heated):
            return theta
        if wp.static(finite):
            J = wp.float64(1.0) + wp.float64(theta)
            return R(J * wp.exp(-wp.float64(swelling)) - wp.float64(1.0))
        return theta - swelling

    return swelling_of, elastic_dilatation


@cache
def peaks_function(precision: str, law_name: str, finite: bool, points: int) -> Any:
    """The function that keeps von Mises stress and plastic strain of points where greatest, see `records.extremes`."""
    t, cauchy = scalars(precision), law_kinematics(precision, law_name, finite).cauchy
    R, vec3, mat33 = t.real, t.vec3, t.mat33
    flows = law_functions(law_name, precision).plastic_row >= 0

    @wp.func
    def keep_peaks(e: int, g: int, H: mat33, S: mat33, N: mat33, d: vec3, p: R, peak_out: wp.array2d(dtype=wp.float32)):
        sigma = cauchy(H, S, N, d, R(0.0))  # the pressure does not count
        trace = wp.trace(sigma)
        square = R(1.5) * wp.max(wp.ddot(sigma, sigma) - R(THIRD) * trace * trace, R(0.0))
        record = peak_out[wp.static(RECORDS), e]
        keep_peak(wp.static(VON_MISES), e, wp.float32(wp.sqrt(square)), record, peak_out)
        if wp.static(flows):
            keep_peak(wp.static(PLASTIC_STRAIN), e, wp.float32(p), record, peak_out)
        last = wp.where(g == wp.static(points - 1), wp.float32(1.0), wp.float32(0.0))
        peak_out[wp.static(RECORDS), e] = record + last

    return keep_peaks


@cache
def energy_kernel(maker: Maker, precision: str, law_name: str, finite: bool = False, heated: bool = False) -> Any:
    """Kernel: elastic, plastic and hourglass energy [J], greatest strain and smallest Jacobian ratio [-] so far.

    peak_out keeps the greatest von Mises stress [Pa] and plastic strain [-] of any record, see `records.extremes`.

    The points' own Jacobians are those of this step; of the steps between, the force kernels keep that of the centre.
    An inverted element's Q is a reflection, which would hide the inversion in its own frame.
    """
    form, point, place = parts_of(maker, precision, law_name, finite)
    load = load_function(maker, precision, law_name, finite)
    gradient, rotation, modes, points = form.gradient, form.rotation, form.modes, form.points
    shared, own = shared_function(maker, precision, law_name, finite, heated), form.pressure in (OWN, SPLIT)
    own_modulus, mean_modulus = modulus_functions(form, precision)
    swelling_of, elastic_dilatation = swelling_functions(precision, finite, heated)
    plastic, general, read = bool(law_name), point.general, point.read
    has_modes, lags = form.modes is not None, form.lags
    # one pass over the points: a second would not fit side by side
    late = form.pressure in (MEAN, SPLIT) and not general
    k, R = law_kinematics(precision, law_name, finite), scalars(precision).real
    dilatation_of, deviator, volumetric_energy = k.dilatation, k.deviator, k.volumetric_energy
    keep_peaks = peaks_function(precision, law_name, finite, points)

    # logarithms need all their digits
    @wp.kernel(enable_backward=False, module="unique", grid_stride=False, module_options={"fast_math": not finite})
    def element_energy(
        X: wp.array(dtype=wp.vec3d),
        conn: wp.array2d(dtype=wp.int32),
        material: wp.array(dtype=wp.int32),
        law: wp.array2d(dtype=R),
        yielded: wp.array(dtype=wp.int32),
        history: wp.array2d(dtype=R),
        extreme: wp.array2d(dtype=R),
        u: wp.array(dtype=wp.vec3d),
        first: int,
        group: wp.array2d(dtype=wp.int32),
        dilatation: wp.array(dtype=R),
        energy_out: wp.array2d(dtype=R),
        peak_out: wp.array2d(dtype=wp.float32),
    ):
        e = wp.tid()
        m = material[e]
        K, G = law[m, 0], law[m, 1]
        flag = int(0)
        if wp.static(plastic):
            flag = yielded[e]
        shape = load(X, u, conn, e, m, flag, law, history)
        identity = wp.identity(n=3, dtype=R)
        theta, elastic, swelling = R(0.0), R(0.0), swelling_of(e, K, extreme)
        if wp.static(not late):
            theta, _pressure, elastic = shared(shape, e, K, swelling, group, dilatation)
        volume, growth, dissipated = R(0.0), R(0.0), R(0.0)
        largest = extreme[STRAIN_SQUARE, e]
        smallest = R(1.0)
        for g in range(wp.static(points)):
            weight, H = gradient(shape, g)
            strain, N, d = deviator(H)
            largest = wp.max(largest, wp.ddot(strain, strain))
            if wp.static(own):
                theta = dilatation_of(H)
            if wp.static(late):
                volume += weight
                growth += dilatation_of(H) * weight
            S, _pressure, p, stored, spent = read(strain, theta, G, place(g), e, m, flag, law, history)
            keep_peaks(e, g, H, S, N, d, p, peak_out)
            if wp.static(own and not general):
                stored += volumetric_energy(own_modulus(shape, K, G), elastic_dilatation(theta, swelling))
            elastic += weight * stored
            dissipated += weight * spent
            smallest = wp.min(smallest, wp.determinant(identity + H))
        if wp.static(late):
            theta = elastic_dilatation(growth / volume, swelling)
            elastic += volume * volumetric_energy(mean_modulus(shape, K, G), theta)
        energy_out[0, first + e] = elastic
        energy_out[2, first + e] = wp.sqrt(R(2.0) / R(3.0) * largest)
        smallest = smallest * wp.determinant(identity + rotation(shape))
        energy_out[3, first + e] = wp.min(smallest, R(1.0) - extreme[VOLUME_LOSS, e])
        hourglass = R(0.0)
        if wp.static(lags):
            hourglass = extreme[LAG_LOSS, e]
        if wp.static(has_modes):
            hourglass, spent = modes(shape, K, G, flag, history, e)
            dissipated += spent
        energy_out[1, first + e] = dissipated
        energy_out[4, first + e] = hourglass

    return element_energy


@cache
def stress_kernel(maker: Maker, precision: str, law_name: str, finite: bool = False) -> Any:
    """Kernel: stress [Pa] and plastic strain [-] at the points of some elements, in the world frame.

    A point's values go to the slots of the corners that show them: rows xx, yy, zz, xy, yz, xz, p.
    """
    form, point, place = parts_of(maker, precision, law_name, finite)
    load = load_function(maker, precision, law_name, finite)
    gradient, rotation, corner_of = form.gradient, form.rotation, form.corner_of
    points, corners, shown = form.points, form.corners, form.shown
    shared, own = shared_function(maker, precision, law_name, finite), form.pressure in (OWN, SPLIT)
    own_modulus, mean_modulus = modulus_functions(form, precision)
    plastic, general, read = bool(law_name), point.general, point.read
    k, R = law_kinematics(precision, law_name, finite), scalars(precision).real
    dilatation_of, deviator, pressure_of, cauchy = k.dilatation, k.deviator, k.pressure, k.cauchy

    @wp.kernel(enable_backward=False, module="unique")
    def element_stress(
        X: wp.array(dtype=wp.vec3d),
        conn: wp.array2d(dtype=wp.int32),
        material: wp.array(dtype=wp.int32),
        law: wp.array2d(dtype=R),
        yielded: wp.array(dtype=wp.int32),
        history: wp.array2d(dtype=R),
        u: wp.array(dtype=wp.vec3d),
        element: wp.array(dtype=wp.int32),
        first: int,
        group: wp.array2d(dtype=wp.int32),
        dilatation: wp.array(dtype=R),
        stress_out: wp.array2d(dtype=wp.float32),
    ):
        item = wp.tid()
        e = element[item]
        m = material[e]
        K = law[m, 0]
        flag = int(0)
        if wp.static(plastic):
            flag = yielded[e]
        shape = load(X, u, conn, e, m, flag, law, history)
        Q = wp.identity(n=3, dtype=R) + rotation(shape)
        theta, mean_pressure, _energy = shared(shape, e, mean_modulus(shape, K, law[m, 1]), R(0.0), group, dilatation)
        for g in range(wp.static(points)):
            _weight, H = gradient(shape, g)
            strain, N, d = deviator(H)
            if wp.static(own):
                theta = dilatation_of(H)
            S, pressure, p, _stored, _spent = read(strain, theta, law[m, 1], place(g), e, m, flag, law, history)
            if wp.static(not general):
                pressure = mean_pressure
                if wp.static(own):
                    pressure = mean_pressure + pressure_of(own_modulus(shape, K, law[m, 1]), theta)
            local = cauchy(H, S, N, d, pressure)
            sigma = Q * local * wp.transpose(Q)
            for j in range(wp.static(shown)):
                slot = first + wp.static(corners) * item + corner_of(g, j)
                stress_out[0, slot] = wp.float32(sigma[0, 0])
                stress_out[1, slot] = wp.float32(sigma[1, 1])
                stress_out[2, slot] = wp.float32(sigma[2, 2])
                stress_out[3, slot] = wp.float32(sigma[0, 1])
                stress_out[4, slot] = wp.float32(sigma[1, 2])
                stress_out[5, slot] = wp.float32(sigma[0, 2])
                stress_out[6, slot] = wp.float32(p)

    return element_stress
