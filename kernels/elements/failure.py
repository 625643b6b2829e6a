"""Owns the kernels of elements that may fail: what they read of nodes, when they fail, and what fails with them.

A failed element gives its nodes no force from the step n on that finds it. What it reads of its nodes stays as it was
then, so that its history and its energies stay, too, and nothing that its nodes do later inverts it. Central
differences have half of the work of f(n) in the step before, dt f(n) . v(n-1/2) / 2, which is missing then: what the
element had stored at t(n) goes less that work.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.formulation import OWN, SPLIT, Maker, load_function, modulus_functions, parts_of
from warp_mca.kernels.elements.readings import shared_function
from warp_mca.kernels.failure.criteria import criterion, parameter_type, point_type
from warp_mca.kernels.hardware.block import block_sum
from warp_mca.kernels.hardware.scalars import THIRD, scalars
from warp_mca.kernels.materials.flow import history_functions
from warp_mca.kernels.materials.isochoric import law_kinematics
from warp_mca.kernels.materials.laws import law_functions
from warp_mca.kernels.records.ledger import run_of

wp.set_module_options({"enable_backward": False})

ENERGIES, FAILED = 7, 6  # rows of `Workspace.energy` where elements may fail; that of what failed with them [J]


@wp.kernel(enable_backward=False)
def follow_nodes(
    u: wp.array(dtype=wp.vec3d),
    conn: wp.array2d(dtype=wp.int32),
    age: wp.array(dtype=wp.int32),
    count: int,
    first: int,
    u_out: wp.array(dtype=wp.vec3d),
):
    """Displacements of the corners of elements from `first` on [m], of which u_out has `count` for each corner."""
    e = first + wp.tid()
    if age[e] >= 0:
        for a in range(conn.shape[0]):
            u_out[a * count + e] = u[conn[a, e]]


@cache
def temperature_function(precision: str, law_name: str) -> Any:
    """The function (history, place, e, law, m) -> T* of a point, 0 for laws without temperature."""
    R, functions = scalars(precision).real, law_functions(law_name, precision)
    temperature, warm = functions.temperature, functions.temperature is not None
    read_parameters = functions.parameters
    read_history, _ = history_functions(precision, law_name)

    @wp.func
    def temperature_of(history: wp.array2d(dtype=R), place: int, e: int, law: wp.array2d(dtype=R), m: int):
        found = R(0.0)
        if wp.static(warm):
            found = temperature(read_history(history, place, e), read_parameters(law, m, R(1.0)))
        return found

    return temperature_of


@cache
def point_function(maker: Maker, precision: str, law_name: str, finite: bool) -> Any:
    """The function (struct, theta, pressure, g, e, m, flag, law, history, before, dt, scale) -> `point_type` of g.

    theta and pressure are those that points share, `before` is p in the step before.
    """
    form, point, place = parts_of(maker, precision, law_name, finite)
    struct, gradient, general, read = form.struct, form.gradient, point.general, point.read
    own, (own_modulus, _) = form.pressure in (OWN, SPLIT), modulus_functions(form, precision)
    k, R, Point = law_kinematics(precision, law_name, finite), scalars(precision).real, point_type(precision)
    dilatation_of, deviator, pressure_of, cauchy, volume_strain = (
        k.dilatation,
        k.deviator,
        k.pressure,
        k.cauchy,
        k.volume_strain,
    )
    temperature_of = temperature_function(precision, law_name)

    @wp.func
    def seen_point(
        shape: struct,
        theta: R,
        pressure: R,
        g: int,
        e: int,
        m: int,
        flag: int,
        law: wp.array2d(dtype=R),
        history: wp.array2d(dtype=R),
        before: R,
        dt: R,
        scale: R,
    ):
        _weight, H = gradient(shape, g)
        strain, N, d = deviator(H)
        if wp.static(own):
            theta = dilatation_of(H)
            pressure = pressure + pressure_of(own_modulus(shape, law[m, 0], law[m, 1]), theta)
        S, local, p, _stored, _spent = read(strain, theta, law[m, 1], place(g), e, m, flag, law, history)
        if wp.static(general):
            pressure = local
        found = Point()
        found.stress = cauchy(H, S, N, d, pressure)
        found.strain = strain + R(THIRD) * volume_strain(theta) * wp.identity(n=3, dtype=R)
        found.p = p
        found.dp = p - before
        found.rate = found.dp / dt
        found.temperature = R(0.0)
        if flag != 0:
            found.temperature = temperature_of(history, place(g), e, law, m)
        found.scale = scale
        return found

    return seen_point


@cache
def failure_kernel(maker: Maker, failure: str, precision: str, law_name: str, finite: bool = False) -> Any:
    """Kernel: damage of the points of each element, by the criterion in the module `failure`; no force from 1 on.

    `parameter` has the factor on strains at failure and then the parameters of each element's criterion; `age` the
    steps that an element has taken, or -1 less these once it has failed. v are velocities at the latest half step of
    the nodes that `node` gives, corner by corner.
    """
    form, _, _ = parts_of(maker, precision, law_name, finite)
    load = load_function(maker, precision, law_name, finite)
    points, corners, plastic = form.points, form.corners, bool(law_name)
    _, mean_modulus = modulus_functions(form, precision)
    shared, seen = (make(maker, precision, law_name, finite) for make in (shared_function, point_function))
    damage, width = criterion(failure, precision)
    R, vec3, row = scalars(precision).real, scalars(precision).vec3, parameter_type(precision, width)

    @wp.kernel(enable_backward=False, module="unique")
    def element_failure(
        X: wp.array(dtype=wp.vec3d),
        conn: wp.array2d(dtype=wp.int32),
        material: wp.array(dtype=wp.int32),
        law: wp.array2d(dtype=R),
        yielded: wp.array(dtype=wp.int32),
        history: wp.array2d(dtype=R),
        u: wp.array(dtype=wp.vec3d),
        group: wp.array2d(dtype=wp.int32),
        dilatation: wp.array(dtype=R),
        parameter: wp.array2d(dtype=R),
        v: wp.array(dtype=wp.vec3d),
        node: wp.array2d(dtype=wp.int32),
        slot: int,
        count: int,
        dt: R,
        damage_out: wp.array2d(dtype=wp.float64),
        plastic_out: wp.array2d(dtype=R),
        age_out: wp.array(dtype=wp.int32),
        work_out: wp.array(dtype=R),
        failed_out: wp.array(dtype=wp.int32),
        force_out: wp.array(dtype=vec3),
    ):
        e = wp.tid()
        age = age_out[e]
        if age >= 0:
            m = material[e]
            flag = int(0)
            if wp.static(plastic):
                flag = yielded[e]
            shape = load(X, u, conn, e, m, flag, law, history)
            K = mean_modulus(shape, law[m, 0], law[m, 1])
            theta, pressure, _energy = shared(shape, e, K, R(0.0), group, dilatation)
            c = row()
            for i in range(wp.static(width)):
                c[i] = parameter[1 + i, e]
            worst = wp.float64(0.0)
            for g in range(wp.static(points)):
                before = plastic_out[g, e]
                point = seen(shape, theta, pressure, g, e, m, flag, law, history, before, dt, parameter[0, e])
                D = damage(damage_out[g, e], point, c)
                damage_out[g, e] = D
                plastic_out[g, e] = point.p
                worst = wp.max(worst, D)
            age = wp.where(worst >= wp.float64(1.0), -1 - age, age + 1)
            age_out[e] = age
            if age < 0:
                work = R(0.0)
                for a in range(wp.static(corners)):
                    w = v[node[a, e]]
                    work += wp.dot(force_out[slot + a * count + e], vec3(R(w[0]), R(w[1]), R(w[2])))
                work_out[e] = R(0.5) * dt * work
                wp.atomic_add(failed_out, 0, 1)
        if age < 0:
            for a in range(wp.static(corners)):
                for i in range(3):
                    force_out[slot + a * count + e][i] = R(0.0)

    return element_failure


@cache
def silence_kernel(real: str) -> Any:
    """Kernel: no force of elements that have failed, of those that `element` lists, in slots of `real` numbers."""
    vec3 = scalars("mixed" if real == "float32" else "float64").vec3

    @wp.kernel(enable_backward=False, module="unique")
    def silence(
        age: wp.array(dtype=wp.int32),
        element: wp.array(dtype=wp.int32),
        slot: int,
        corners: int,
        force_out: wp.array(dtype=vec3),
    ):
        i = wp.tid()
        if age[element[i]] < 0:
            for a in range(corners):
                force_out[slot + a * element.shape[0] + i] = vec3()

    return silence


@cache
def lose_kernel(precision: str) -> Any:
    """Kernel: elastic and hourglass energy of elements that failed become what failed with them [J]; see above."""
    R = scalars(precision).real

    @wp.kernel(enable_backward=False, module="unique")
    def lose_energy(
        age: wp.array(dtype=wp.int32), work: wp.array(dtype=R), first: int, energy_out: wp.array2d(dtype=R)
    ):
        i = wp.tid()
        e = first + i
        lost = R(0.0)
        if age[i] < 0:
            lost = energy_out[0, e] + energy_out[4, e] + work[i]
            energy_out[0, e] = R(0.0)
            energy_out[4, e] = R(0.0)
        energy_out[wp.static(FAILED), e] = lost

    return lose_energy


@cache
def sum_failed_kernel(precision: str) -> Any:
    """Kernel: energy that failed with elements of each scene, into one column of a record."""
    R = scalars(precision).real

    @wp.kernel(enable_backward=False, module="unique")
    def sum_failed(
        row: wp.array(dtype=wp.int32),
        energy: wp.array2d(dtype=R),
        ranges: wp.array3d(dtype=wp.int32),
        column: int,
        partial_out: wp.array4d(dtype=wp.float64),
    ):
        scene, k, lane = wp.tid()
        total = wp.float64(0.0)
        for b in range(ranges.shape[1]):
            begin, end = run_of(ranges[scene, b, 0], ranges[scene, b, 1], k)
            for e in range(begin + lane, end, wp.block_dim()):
                total += wp.float64(energy[wp.static(FAILED), e])
        total = block_sum(total)
        if lane == 0:
            partial_out[row[0], scene, column, k] = total

    return sum_failed
