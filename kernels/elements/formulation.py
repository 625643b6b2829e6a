"""Owns what a formulation of elements is to the kernels, and the forces of one whose points each have their pressure.

A formulation says where its points lie and which change of volume gives the pressure; strain, material point, energy
and stress are the same for all.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from warp_mca.base.errors import bad_value
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.materials.isochoric import law_kinematics
from warp_mca.kernels.materials.point import material_point
from warp_mca.kernels.records.extremes import keep_functions

wp.set_module_options({"enable_backward": False})

OWN, MEAN, NODAL, SPLIT = "own", "mean", "nodal", "split"
# Greatest K / G that points of a SPLIT pressure have to themselves, with internal vectors (nu = 0.480), without (0.406)
OWN_SHARE, OWN_ALONE = 25.0, 5.0


@dataclass(frozen=True)
class Formulation:
    """An element of one precision, law and strain measure.

    Attributes:
        name: of the element.
        corners, points: numbers of its nodes and of its integration points.
        pressure: from which change of volume it comes: OWN of each point, MEAN of the element, NODAL of the pressure
            nodes of each corner, which `ElementStage.nodal` gives; SPLIT, OWN with the K that `split` gives and MEAN
            with the rest.
        struct: what the functions below need of an element.
        load: (X, u, conn, e) -> struct.
        gradient: (struct, g) -> (volume of point g [m^3], displacement gradient there in the element's frame).
        rotation: struct -> W = Q - I of that frame.
        shown: corners that show the stress of one point.
        corner_of: (g, j) -> corner number j < `shown` that shows the stress of point g.
        slope: (struct, g, a) -> volume times gradient of the shape function of node a at point g [m^2]; for
            `force_kernel` only.
        place: g -> number of point g in the history.
        enriched: (struct, e, m, flag, law, history) -> struct with what the history adds; None if nothing does.
        modes: (struct, K, G, flag, history, e) -> (stored, dissipated) energy of what deforms without strain at the
            points [J]; None where nothing does.
        lags: whether internal vectors lag behind: their extremes have a row LAG_LOSS, the energy that this took [J].
        split: (struct, K, G) -> bulk modulus of a point's own change of volume [Pa], where the pressure is SPLIT.
    """

    name: str
    corners: int
    points: int
    pressure: str
    struct: Any
    load: Any
    gradient: Any
    rotation: Any
    shown: int
    corner_of: Any
    slope: Any = None
    place: Any = None
    enriched: Any = None
    modes: Any = None
    lags: bool = False
    split: Any = None


Maker = Callable[[str, str, bool], Formulation]  # of a precision, a law, and whether strains may be large


@cache
def own_modulus_function(precision: str) -> Any:
    """The function (K, G, share) -> bulk modulus of a point's own change of volume [Pa], where a share of the internal
    vectors is left. Without these, points with a large K of their own would lock, as in an element of displacements."""
    R, by_vectors = scalars(precision).real, OWN_SHARE - OWN_ALONE

    @wp.func
    def own_modulus(K: R, G: R, share: R):
        return wp.min(K, (R(OWN_ALONE) + share * R(by_vectors)) * G)

    return own_modulus


def modulus_functions(form: Formulation, precision: str) -> tuple[Any, Any]:
    """Functions (struct, K, G) -> bulk modulus of a point's own change of volume, and of the mean one [Pa]; all of K,
    each, where the pressure is not split."""
    R, struct, splits, split = scalars(precision).real, form.struct, form.pressure == SPLIT, form.split

    @wp.func
    def own_modulus(shape: struct, K: R, G: R):
        if wp.static(splits):
            return split(shape, K, G)
        return K

    @wp.func
    def mean_modulus(shape: struct, K: R, G: R):
        if wp.static(splits):
            return K - split(shape, K, G)
        return K

    return own_modulus, mean_modulus


@wp.func
def same_place(g: int):
    return g


@cache
def load_function(maker: Maker, precision: str, law_name: str, finite: bool) -> Any:
    """The function (X, u, conn, e, m, flag, law, history) -> struct of a formulation, with what the history adds."""
    form, R = maker(precision, law_name, finite), scalars(precision).real
    load_shape, enriched, adds = form.load, form.enriched or form.load, form.enriched is not None

    @wp.func
    def load(
        X: wp.array(dtype=wp.vec3d),
        u: wp.array(dtype=wp.vec3d),
        conn: wp.array2d(dtype=wp.int32),
        e: int,
        m: int,
        flag: int,
        law: wp.array2d(dtype=R),
        history: wp.array2d(dtype=R),
    ):
        shape = load_shape(X, u, conn, e)
        if wp.static(adds):
            shape = enriched(shape, e, m, flag, law, history)
        return shape

    return load


def parts_of(maker: Maker, precision: str, law_name: str, finite: bool) -> tuple[Formulation, Any, Any]:
    """A formulation, its material point, and the place of a point in the history.

    Raises:
        RequestError: the law gives the pressure of a point, where the element takes that of its nodes.
    """
    form = maker(precision, law_name, finite)
    point = material_point(precision, law_name, finite)
    if point.general and form.pressure == NODAL:
        remedy = "its material gives the pressure at each point, and this element that of its nodes; choose tet10"
        raise bad_value("Body.element", form.name, remedy)
    return form, point, form.place or same_place


@cache
def force_kernel(maker: Maker, precision: str, law_name: str, finite: bool = False) -> Any:
    """Kernel: forces -V P grad N of the points of each element on its nodes [N], with the pressure of each point."""
    form, point, place = parts_of(maker, precision, law_name, finite)
    load_shape, gradient, rotation, slope = form.load, form.gradient, form.rotation, form.slope
    points, corners, update = form.points, form.corners, point.update
    plastic, general = bool(law_name), point.general
    t = scalars(precision)
    R, vec3, forces = t.real, t.vec3, wp.types.matrix((corners, 3), t.real)
    keep_strain, keep_volume, _ = keep_functions(R)
    k = law_kinematics(precision, law_name, finite)
    dilatation_of, deviator, pressure_of, nominal = k.dilatation, k.deviator, k.pressure, k.nominal

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False)
    def element_force(
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
        shape = load_shape(X, u, conn, e)
        m = material[e]
        flag = int(0)
        if wp.static(plastic):
            flag = yielded_out[e]
        flows = int(flag)
        W = rotation(shape)
        largest = R(0.0)
        smallest = R(1.0)
        f = forces()
        for g in range(wp.static(points)):
            _weight, H = gradient(shape, g)
            strain, N, d = deviator(H)
            theta = dilatation_of(H)
            largest = wp.max(largest, wp.ddot(strain, strain))
            smallest = wp.min(smallest, wp.determinant(wp.identity(n=3, dtype=R) + H))
            S, pressure, dp = update(strain, theta, law[m, 1], place(g), e, m, flag, law, dt, history_out)
            if dp > R(0.0):
                flows = int(1)
            if wp.static(not general):
                pressure = pressure_of(law[m, 0], theta)
            P = nominal(H, S, N, d, pressure)
            P = P + W * P
            for a in range(wp.static(corners)):
                f[a] = f[a] - P * slope(shape, g, a)
        if wp.static(plastic):
            if flows != flag:
                yielded_out[e] = flows
        keep_strain(e, largest, extreme_out)
        keep_volume(e, R(1.0) - smallest, extreme_out)
        for a in range(wp.static(corners)):
            for i in range(3):  # by components, as in `hexahedron.store_function`
                force_out[slot + a * count + e][i] = f[a, i]

    return element_force
