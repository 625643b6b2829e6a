"""Taylor's test by axisymmetric elements without warp_mca: `python -m benchmarks.taylor_axisymmetric --help`.

4-node elements, 2 x 2 points and mean dilatation as Simo, Taylor and Pister (1985), central differences,
a step that follows the deformed mesh, float64. Three laws of J2 plasticity: `multiplicative`, F = F_e F_p with
logarithmic elastic strain (Simo, Comput. Meth. Appl. Mech. Engng 99 (1992) 61); `hypoelastic`, Jaumann's rate of the
stress by Hughes and Winget (Int. J. Numer. Meth. Engng 15 (1980) 1862); `additive` in logarithmic strain, which is
warp_mca's (Miehe, Apel and Lambrecht, Comput. Meth. Appl. Mech. Engng 191 (2002) 5383).
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
# Components of what is symmetric about the axis: rr, zz, rz, and around it; of a gradient rr, rz, zr, zz, around.
Symmetric = tuple[Array, ...]
Gradient = tuple[Array, ...]

LENGTH, RADIUS, SPEED, DURATION = 32.4e-3, 3.2e-3, 227.0, 80e-6
E, NU, RHO, YIELD, E_T = 117e9, 0.35, 8930.0, 400e6, 100e6
_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


@dataclass
class Metal:
    """Bilinear hardening. Laws with rates read `dt`, the step [s], and keep what they need.

    Attributes:
        length, radius, speed, duration: of the bar and its impact [m], [m/s], [s].
        E, nu, rho: [Pa], [-], [kg/m^3].
    """

    length: float = LENGTH
    radius: float = RADIUS
    speed: float = SPEED
    duration: float = DURATION
    E: float = E
    nu: float = NU
    rho: float = RHO
    dt: float = 0.0

    def __post_init__(self) -> None:
        self.K, self.G = self.E / (3.0 - 6.0 * self.nu), self.E / (2.0 + 2.0 * self.nu)
        self.sound = ((self.K + 4.0 / 3.0 * self.G) / self.rho) ** 0.5

    def growth(self, size: Array, p: Array) -> Array:
        """Of the equivalent plastic strain p, where a trial stress has this size [Pa]."""
        H = E * E_T / (E - E_T)
        return np.maximum(size - YIELD - H * p, 0.0) / (3.0 * self.G + H)


@dataclass
class JohnsonCook(Metal):
    """Their flow stress with adiabatic heating; parameters as in `warp_mca.JohnsonCook`, which starts at T_room."""

    A: float = 90e6
    B: float = 292e6
    n: float = 0.31
    C: float = 0.025
    m: float = 1.09
    span: float = 1063.0
    c_p: float = 383.0
    beta: float = 0.9

    def __post_init__(self) -> None:
        super().__post_init__()
        self.work: Array = np.zeros(1)

    def strength(self, p: Array, dp: Array, work: Array) -> Array:
        """Flow stress [Pa] at the end of a step."""
        hot = np.minimum(self.beta * work / (self.rho * self.c_p * self.span), 1.0)
        fast = 1.0 + self.C * np.log(np.maximum(dp / self.dt, 1.0))
        return (self.A + self.B * p**self.n) * fast * (1.0 - hot**self.m)

    def growth(self, size: Array, p: Array) -> Array:
        """By the secant rule of Illinois, within brackets."""
        self.work = np.broadcast_to(self.work, p.shape).copy()
        dp, at = np.zeros_like(p), np.flatnonzero(size > self.strength(p, np.zeros_like(p), self.work))
        if not len(at):
            return dp
        q, old, work = size.flat[at], p.flat[at], self.work.flat[at]

        def left(x: Array) -> Array:
            return 3.0 * self.G * x + self.strength(old + x, x, work) - q

        a, b = np.zeros_like(q), q / (3.0 * self.G)
        fa, fb = left(a), left(b)
        for _ in range(60):
            x = (a * fb - b * fa) / (fb - fa)
            f = left(x)
            if np.abs(f).max() < 1e-8 * q.max():
                break
            other = f * fb < 0.0
            a, fa = np.where(other, b, a), np.where(other, fb, 0.5 * fa)
            b, fb = x, f
        dp.flat[at] = x
        self.work.flat[at] += (q - 3.0 * self.G * x) * x
        return dp


@dataclass(frozen=True)
class Mesh:
    """Arrays of elements e, points g, nodes a.

    Attributes:
        X: r and z [m], shape (node_count, 2). conn: nodes of elements, shape (element_count, 4).
        b: gradients of shape functions [1/m], shape (element_count, 4 points, 4 nodes, 2); hoop: N_a / R.
        weight: volume of each point [m^3]. mass: lumped [kg], shape (node_count,).
    """

    X: Array
    conn: NDArray[np.int64]
    b: Array
    hoop: Array
    weight: Array
    mass: Array


def make_mesh(across: int, along: int, metal: Metal) -> Mesh:
    """Equal rectangles; the wall is z = 0."""
    z, r = np.meshgrid(
        np.linspace(0.0, metal.length, along + 1), np.linspace(0.0, metal.radius, across + 1), indexing="ij"
    )
    X = np.column_stack([r.ravel(), z.ravel()])
    index = np.arange(len(X)).reshape(along + 1, across + 1)
    conn = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], axis=-1).reshape(-1, 4)
    factor = 1.0 + _CORNERS[:, None, :] / 3.0**0.5 * _CORNERS
    shape = factor.prod(axis=-1) / 4.0
    slope = np.stack([_CORNERS[:, 0] * factor[..., 1], _CORNERS[:, 1] * factor[..., 0]], axis=-1) / 4.0
    jacobian = np.einsum("gak,eai->egik", slope, X[conn])
    R = X[conn][..., 0] @ shape.T
    weight = 2.0 * np.pi * R * np.linalg.det(jacobian)
    mass = np.bincount(conn.ravel(), (metal.rho * weight @ shape).ravel(), len(X))
    b = np.einsum("gak,egki->egai", slope, np.linalg.inv(jacobian))
    return Mesh(X, conn, b, shape / R[..., None], weight, mass)


def gradient(mesh: Mesh, x: Array) -> Gradient:
    """F at every point."""
    F = np.einsum("eai,egaj->egij", x[mesh.conn], mesh.b, optimize=True)
    around = np.einsum("ea,ega->eg", x[mesh.conn][..., 0], mesh.hoop)
    return F[..., 0, 0], F[..., 0, 1], F[..., 1, 0], F[..., 1, 1], around


def plastic_step(s: Symmetric, p: Array, metal: Metal) -> tuple[Array, Array]:
    """Radial return: what a trial deviator shrinks by, and the growth of the equivalent plastic strain."""
    size = np.sqrt(1.5 * (s[0] ** 2 + s[1] ** 2 + 2.0 * s[2] ** 2 + s[3] ** 2))
    dp = metal.growth(size, p)
    return 1.0 - 3.0 * metal.G * dp / np.maximum(size, 1.0), dp


def push(a: Array, b: Array, c: Array, d: Array, s: Symmetric, around: Array) -> Symmetric:
    """A s A^T with A = ((a, b), (c, d)) in the plane."""
    ar, az = a * s[0] + b * s[2], a * s[2] + b * s[1]
    cr, cz = c * s[0] + d * s[2], c * s[2] + d * s[1]
    return ar * a + az * b, cr * c + cz * d, ar * c + az * d, around * s[3] * around


def multiplicative(
    state: Symmetric, F: Gradient, before: Gradient, p: Array, metal: Metal
) -> tuple[Symmetric, Symmetric, Array]:
    """Deviatoric Kirchhoff stress [Pa]; the state is the inverse of C_p."""
    rr, rz, zr, zz, around = F
    values, c, s = principal(push(rr, rz, zr, zz, state, around))
    strain = [0.5 * np.log(value) for value in values]
    mean = sum(strain) / 3.0
    trial = [2.0 * metal.G * (e - mean) for e in strain]
    kept, dp = plastic_step((trial[0], trial[1], np.zeros_like(p), trial[2]), p, metal)
    tau = [kept * value for value in trial]
    elastic = [np.exp(value / metal.G + 2.0 * mean) for value in tau]
    J = rr * zz - rz * zr
    state = push(zz / J, -rz / J, -zr / J, rr / J, _turned(elastic, c, s), 1.0 / around)
    return _turned(tau, c, s), state, p + dp


def principal(b: Symmetric) -> tuple[list[Array], Array, Array]:
    """Eigenvalues, the last around the axis, and cosine and sine of the angle to the first direction."""
    first = 0.5 * (b[0] + b[1]) + np.hypot(0.5 * (b[0] - b[1]), b[2])
    angle = 0.5 * np.arctan2(2.0 * b[2], b[0] - b[1])
    return [first, (b[0] * b[1] - b[2] ** 2) / first, b[3]], np.cos(angle), np.sin(angle)


def _turned(value: list[Array], c: Array, s: Array) -> Symmetric:
    first, second, around = value
    return first * c * c + second * s * s, first * s * s + second * c * c, (first - second) * c * s, around


def additive(
    state: Symmetric, F: Gradient, before: Gradient, p: Array, metal: Metal
) -> tuple[Symmetric, Symmetric, Array]:
    """Deviatoric Kirchhoff stress [Pa]; the state is the plastic strain."""
    rr, rz, zr, zz, around = F
    one, none = np.ones_like(p), np.zeros_like(p)
    values, c, s = principal(push(rr, zr, rz, zz, (one, one, none, one), around))
    strain = [0.5 * np.log(value) for value in values]
    mean = sum(strain) / 3.0
    e = _turned([value - mean for value in strain], c, s)
    trial = tuple(2.0 * metal.G * (a - b) for a, b in zip(e, state, strict=True))
    kept, dp = plastic_step(trial, p, metal)
    T = tuple(kept * value for value in trial)
    state = tuple(a - b / (2.0 * metal.G) for a, b in zip(e, T, strict=True))
    first, second, last = values
    gap = np.maximum((first - second) / second, 1e-12)
    T = push(c, s, -s, c, T, one)
    T = (T[0] / first, T[1] / second, T[2] * np.log1p(gap) / gap / second, T[3] / last)
    return push(rr, rz, zr, zz, push(c, -s, s, c, T, one), around), state, p + dp


def hypoelastic(
    state: Symmetric, F: Gradient, before: Gradient, p: Array, metal: Metal
) -> tuple[Symmetric, Symmetric, Array]:
    """Deviatoric Kirchhoff stress [Pa]; the state is the deviator of Cauchy's."""
    rr, rz, zr, zz, around = (0.5 * (new + old) for new, old in zip(F, before, strict=True))
    d = [new - old for new, old in zip(F, before, strict=True)]
    J = rr * zz - rz * zr
    L = ((d[0] * zz - d[1] * zr) / J, (d[1] * rr - d[0] * rz) / J, (d[2] * zz - d[3] * zr) / J)
    L = (*L, (d[3] * rr - d[2] * rz) / J, d[4] / around)
    mean = (L[0] + L[3] + L[4]) / 3.0
    angle = 2.0 * np.arctan(0.25 * (L[2] - L[1]))
    c, s = np.cos(angle), np.sin(angle)
    turned = push(c, -s, s, c, state, np.ones_like(p))
    step = (L[0] - mean, L[3] - mean, 0.5 * (L[1] + L[2]), L[4] - mean)
    trial = tuple(value + 2.0 * metal.G * e for value, e in zip(turned, step, strict=True))
    kept, dp = plastic_step(trial, p, metal)
    sigma = tuple(kept * value for value in trial)
    volume = (F[0] * F[3] - F[1] * F[2]) * F[4]
    return tuple(volume * value for value in sigma), sigma, p + dp


LAWS = {"multiplicative": multiplicative, "hypoelastic": hypoelastic, "additive": additive}


def forces(mesh: Mesh, F: Gradient, tau: Symmetric, metal: Metal) -> Array:
    """On the nodes [N], shape (node_count, 2), with the pressure K ln J / J of an element's mean J."""
    rr, rz, zr, zz, around = F
    plane = rr * zz - rz * zr
    J = (mesh.weight * plane * around).sum(axis=1) / mesh.weight.sum(axis=1)
    p = (metal.K * np.log(J) / J)[:, None] * plane * around
    inverse = zz / plane, -rz / plane, -zr / plane, rr / plane
    rows = (tau[0] + p, tau[2]), (tau[2], tau[1] + p)
    P = [[a * inverse[0] + b * inverse[1], a * inverse[2] + b * inverse[3]] for a, b in rows]
    f = [sum(np.einsum("eg,ega->ea", mesh.weight * row[k], mesh.b[..., k]) for k in (0, 1)) for row in P]
    f[0] = f[0] + np.einsum("eg,ega->ea", mesh.weight * (tau[3] + p) / around, mesh.hoop)
    return np.column_stack([-np.bincount(mesh.conn.ravel(), part.ravel(), len(mesh.X)) for part in f])


def stable_step(mesh: Mesh, x: Array, metal: Metal) -> float:
    """Smallest area over longest side, over the speed of sound [s]."""
    corners = x[mesh.conn]
    one, two = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    area = 0.5 * np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0])
    longest = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)
    return float((area / longest).min()) / metal.sound


def bar(
    across: int, along: int, law: str, held: bool, share: float = 0.6, metal: Metal | None = None
) -> tuple[float, float]:
    """Length, and radius of the foot [m], at the end. `held`: nodes of the foot stay on the wall."""
    metal = metal or Metal()
    mesh = make_mesh(across, along, metal)
    stress = LAWS[law]
    x, v, zero = mesh.X.copy(), np.zeros_like(mesh.X), np.zeros_like(mesh.weight)
    v[:, 1] = -metal.speed
    foot, axis = mesh.X[:, 1] == 0.0, mesh.X[:, 0] == 0.0
    start = 1.0 if law == "multiplicative" else 0.0
    state: Symmetric = (zero + start, zero + start, zero, zero + start)
    p, time, F = zero, 0.0, gradient(mesh, x)
    while time < metal.duration:
        dt = metal.dt = min(share * stable_step(mesh, x, metal), metal.duration - time + 1e-15)
        before, F = F, gradient(mesh, x)
        tau, state, p = stress(state, F, before, p, metal)
        v += dt * forces(mesh, F, tau, metal) / mesh.mass[:, None]
        v[axis, 0] = 0.0
        touches = foot & (held | (x[:, 1] + dt * v[:, 1] < 0.0))
        v[touches, 1] = -x[touches, 1] / dt
        x = x + dt * v
        time += dt
    return float(np.ptp(x[:, 1])), float(x[foot, 0].max())


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.taylor_axisymmetric")
    parser.add_argument("--cells", type=int, nargs="+", default=[4, 8, 16], help="over the radius")
    parser.add_argument("--ratio", type=int, default=9, help="cells along the bar for each over the radius")
    parser.add_argument("--law", choices=tuple(LAWS), default="multiplicative")
    parser.add_argument("--held", action="store_true", help="the foot stays on the wall")
    args = parser.parse_args()
    for cells in args.cells:
        length, radius = bar(cells, args.ratio * cells, args.law, args.held)
        print(f"{cells:3d} cells over the radius: length {1e3 * length:.3f} mm, foot {1e3 * radius:.3f} mm", flush=True)


if __name__ == "__main__":
    main()
