"""Radial return against the exact bilinear response, and its energy against the integral of stress over strain."""

import numpy as np
import pytest
import warp as wp

from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.materials.j2 import plastic_energy, return_map

E, NU, SIGMA_Y, E_T = 70e9, 0.27, 110e6, 27e9
G, H = E / (2.0 * (1.0 + NU)), E * E_T / (E - E_T)


class Point:
    """One material point, driven by its deviatoric strain through the kernel function."""

    def __init__(self, precision: str, beta: float) -> None:
        t = scalars(precision)
        R, vec3, mat33 = t.real, t.vec3, t.mat33
        j2_return, j2_energy = return_map(precision), plastic_energy(precision)

        @wp.kernel(enable_backward=False, module="unique")
        def drive(
            e: wp.array(dtype=mat33),
            beta: R,
            eps_p: wp.array(dtype=mat33),
            p: wp.array(dtype=R),
            S_out: wp.array(dtype=mat33),
            w_out: wp.array(dtype=R),
        ):
            c = vec3(R(SIGMA_Y), R(H), beta)
            S, eps_new, p_new = j2_return(R(2.0) * R(G) * e[0], eps_p[0], p[0], R(G), c)
            eps_p[0] = eps_new
            p[0] = p_new
            S_out[0] = S
            w_out[0] = j2_energy(eps_new, p_new, c)

        self.kernel, self.mat33, self.beta = drive, mat33, beta
        self.eps_p, self.p = (wp.zeros(1, dtype=kind, device="cpu") for kind in (mat33, R))
        self.S, self.w = (wp.full(1, np.nan, dtype=kind, device="cpu") for kind in (mat33, R))

    def __call__(self, e: np.ndarray) -> np.ndarray:
        strain = wp.array(e[None], dtype=self.mat33, device="cpu")
        wp.launch(self.kernel, 1, inputs=[strain, self.beta, self.eps_p, self.p, self.S, self.w], device="cpu")
        return self.S.numpy()[0].astype(float)


def axial(value: float) -> np.ndarray:
    """Deviatoric tensor of a uniaxial state."""
    return value * np.diag([1.0, -0.5, -0.5])


@pytest.mark.parametrize("precision", ["mixed", "float64"])
@pytest.mark.parametrize("beta", [0.0, 0.5, 1.0])
def test_reversed_loading_yields_where_the_hardening_rule_says(beta, precision):
    """After yield to sigma_1 and reversal, yield starts again at sigma_1 - 2 R, R = sigma_y + beta (sigma_1 - sigma_y).

    In terms of deviatoric strain e the response is bilinear with slopes 3 G and 3 G H / (3 G + H) for the axial stress.
    """
    point = Point(precision, beta)
    plastic_slope = 3.0 * G * H / (3.0 * G + H)
    e_yield, e_1 = SIGMA_Y / (3.0 * G), 4.0 * SIGMA_Y / (3.0 * G)
    sigma_1 = SIGMA_Y + plastic_slope * (e_1 - e_yield)
    radius = SIGMA_Y + beta * (sigma_1 - SIGMA_Y)
    e_back = e_1 - 2.0 * radius / (3.0 * G)
    e_2 = e_back - 2.0 * e_yield
    expected = [
        (0.9 * e_yield, 0.9 * SIGMA_Y),
        (e_1, sigma_1),
        (e_back + 0.01 * e_yield, sigma_1 - 2.0 * radius + 0.01 * SIGMA_Y),
        (e_2, sigma_1 - 2.0 * radius - 2.0 * e_yield * plastic_slope),
    ]
    tolerance = 1e-12 if precision == "float64" else 2e-6
    for e, sigma in expected:
        S = point(axial(e))
        assert 1.5 * S[0, 0] == pytest.approx(sigma, abs=tolerance * SIGMA_Y)
        assert pytest.approx(axial(2.0 / 3.0 * sigma), rel=tolerance, abs=tolerance * SIGMA_Y) == S


@pytest.mark.parametrize("beta", [0.0, 0.3, 1.0])
def test_stress_lies_on_the_yield_surface_and_flow_keeps_volume(beta):
    rng = np.random.default_rng(3)
    point = Point("float64", beta)
    for _ in range(20):
        e = rng.normal(0.0, 3e-3, (3, 3))
        e = 0.5 * (e + e.T)
        S = point(e - np.trace(e) / 3.0 * np.eye(3))
        eps_p, p = point.eps_p.numpy()[0], float(point.p.numpy()[0])
        xi = S - 2.0 / 3.0 * (1.0 - beta) * H * eps_p
        assert np.sqrt(1.5 * (xi**2).sum()) <= (SIGMA_Y + beta * H * p) * (1.0 + 1e-12)
        assert abs(np.trace(eps_p)) < 1e-15


@pytest.mark.parametrize("beta", [0.0, 0.4, 1.0])
def test_plastic_energy_is_the_integral_of_stress_over_plastic_strain(beta):
    point = Point("float64", beta)
    angle = np.linspace(0.0, 2.5 * np.pi, 4000)
    path = [
        s * (np.cos(a) * axial(1.0) + np.sin(a) * (np.eye(3)[[1, 0, 2]] - np.diag([0, 0, 1.0])))
        for a, s in zip(angle, np.minimum(1.0, angle) * 4e-3, strict=True)
    ]
    work, S_old, eps_old = 0.0, np.zeros((3, 3)), np.zeros((3, 3))
    for e in path:
        S = point(e)
        eps_p = point.eps_p.numpy()[0].copy()
        work += (0.5 * (S + S_old) * (eps_p - eps_old)).sum()
        S_old, eps_old = S, eps_p
    assert float(point.w.numpy()[0]) == pytest.approx(work, rel=2e-4)  # trapezoids over 4000 steps


def test_rounding_of_many_small_steps_does_not_add_up():
    """Sixty thousand steps to and fro: p is what ten strokes add up to, but for what one rounding makes of it."""
    t = scalars("mixed")
    R, D, vec3, mat33, j2_return = t.real, wp.float64, t.vec3, t.mat33, return_map("mixed")
    e_yield, steps = SIGMA_Y / (3.0 * G), 6_000
    peak = 5.0 * e_yield

    @wp.kernel(enable_backward=False, module="unique")
    def strokes(p_out: wp.array(dtype=R)):
        i = wp.tid()
        eps_p, p = mat33(), R(0.0)
        for k in range(10 * steps + 1):
            way = D(1.0) - D(2.0) * D((k // steps) % 2)
            e = (
                way
                * D(peak)
                * (D(2.0) * D(k % steps) / D(wp.static(float(steps))) - D(1.0))
                * (D(1.0) + D(1e-3) * D(i))
            )
            if k > wp.static(steps // 2):  # from rest
                elastic = R(D(2.0) * D(G) * e) * wp.diag(wp.vec3(1.0, -0.5, -0.5))
                _, eps_p, p = j2_return(elastic, eps_p, p, R(G), vec3(R(SIGMA_Y), R(H), R(0.0)))
        p_out[i] = p

    p = wp.zeros(20, dtype=R, device="cpu")
    wp.launch(strokes, len(p), outputs=[p], device="cpu")
    amplitude = peak * (1.0 + 1e-3 * np.arange(len(p)))
    exact = ((amplitude - e_yield) + 9.0 * 2.0 * (amplitude - e_yield)) * 3.0 * G / (3.0 * G + H)
    np.testing.assert_allclose(p.numpy(), exact, rtol=3e-7)
