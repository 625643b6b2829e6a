"""What strain and laws are made of: logarithm, exponential, power without a call, directions without a branch."""

import numpy as np
import pytest
import warp as wp

from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.hardware.simd import vectorised
from warp_mca.kernels.materials.exponential import exp_function, power_function
from warp_mca.kernels.materials.kinematics import eigen_function
from warp_mca.kernels.materials.logarithm import log_function

PRECISIONS = ("mixed", "float64")


@pytest.mark.parametrize("precision", PRECISIONS)
def test_logarithm_to_three_units_in_the_last_place(precision):
    R = scalars(precision).real
    natural_log = log_function(precision)

    @wp.kernel(enable_backward=False, module="unique")
    def take_log(y: wp.array(dtype=R), log_out: wp.array(dtype=R)):
        i = wp.tid()
        log_out[i] = natural_log(y[i])

    kind = np.float32 if precision == "mixed" else np.float64
    far = np.logspace(-37, 37, 4001) if precision == "mixed" else np.logspace(-300, 300, 4001)
    none = [0.0, -1.0, np.inf, np.nan]
    y = np.concatenate([none, far, 1.0 + np.linspace(-0.6, 1.5, 4001), 1.0 + np.logspace(-15, -1, 500)]).astype(kind)
    out = wp.full(len(y), np.nan, dtype=R, device="cpu")
    wp.launch(vectorised(take_log), len(y), inputs=[wp.array(y, dtype=R, device="cpu")], outputs=[out], device="cpu")
    found, y = out.numpy(), y[len(none) :]
    assert np.isnan(found[: len(none)]).all()
    found, exact = found[len(none) :], np.log(y.astype(np.longdouble))
    assert (found[y == 1.0] == 0.0).all()
    assert (np.abs(found - exact) < 3.0 * np.spacing(np.abs(exact).astype(kind)))[y != 1.0].all()


@pytest.mark.parametrize("precision", PRECISIONS)
def test_exponential_and_power_to_two_units_in_the_last_place(precision):
    R, kind = scalars(precision).real, np.float32 if precision == "mixed" else np.float64
    natural_exp, power = exp_function(precision), power_function(precision)

    @wp.kernel(enable_backward=False, module="unique")
    def take_both(y: wp.array(dtype=R), exp_out: wp.array(dtype=R), root_out: wp.array(dtype=R)):
        i = wp.tid()
        exp_out[i] = natural_exp(y[i])
        root_out[i] = power(y[i], R(0.25))

    end = 87.0 if precision == "mixed" else 708.0
    y = np.concatenate([[np.nan, 0.0, 1e9, -1e9], np.linspace(-end, end, 4001), np.linspace(-1.0, 1.0, 2001)])
    y = y.astype(kind)
    out = [wp.full(len(y), -1.0, dtype=R, device="cpu") for _ in range(2)]
    wp.launch(vectorised(take_both), len(y), inputs=[wp.array(y, dtype=R, device="cpu")], outputs=out, device="cpu")
    found, roots = (o.numpy() for o in out)
    exact = np.exp(y[4:].astype(np.longdouble))
    assert np.isnan(found[0]) and found[1] == 1.0 and found[2] > 1e38 and 0.0 <= found[3] < 1e-37
    assert (np.abs(found[4:] - exact) < 2.0 * np.spacing(exact.astype(kind))).all()
    assert np.isnan(roots[0]) and roots[1] == 0.0
    whole = y[4:] > 0.0
    exact = y[4:][whole].astype(np.longdouble) ** 0.25
    assert np.abs(roots[4:][whole] / exact - 1.0).max() < 10.0 * np.finfo(kind).eps


def decomposed(C: np.ndarray, precision: str) -> tuple[np.ndarray, np.ndarray]:
    """Directions and eigenvalues that the kernels find."""
    t = scalars(precision)
    eigen = eigen_function(precision)

    @wp.kernel(enable_backward=False, module="unique")
    def decompose(C: wp.array(dtype=t.mat33), N_out: wp.array(dtype=t.mat33), d_out: wp.array(dtype=t.vec3)):
        i = wp.tid()
        N, d = eigen(C[i])
        N_out[i] = N
        d_out[i] = d

    N, d = (wp.full(len(C), value=np.nan, dtype=kind, device="cpu") for kind in (t.mat33, t.vec3))
    wp.launch(decompose, len(C), inputs=[wp.array(C, dtype=t.mat33, device="cpu")], outputs=[N, d], device="cpu")
    return N.numpy().astype(float), d.numpy().astype(float)


@pytest.mark.parametrize("precision", PRECISIONS)
def test_strains_whose_squares_underflow_stay_tiny(precision):
    """Where diagonal entries differ by still less, the rotation between them made an eigenvalue of 1e-13 out of 1e-25.

    Ahead of a wave, where a CPU takes subnormal numbers for zero, strains of 1e-19 became 0.05, and metal yielded.
    """
    small, less = (1e-25, 1e-37) if precision == "mixed" else (1e-200, 1e-300)
    C = small * (np.ones((3, 3)) - np.eye(3)) + np.diag([less, 0.0, -less])
    N, d = decomposed(np.array([C, C.T[::-1, ::-1]]), precision)
    assert np.abs(d).max() < 3.0 * small
    assert np.abs(N.transpose(0, 2, 1) @ N - np.eye(3)).max() < 1e-6


@pytest.mark.parametrize("precision", PRECISIONS)
def test_principal_directions(precision):
    """C = N d N^T with orthonormal N: any matrix, diagonal ones, equal eigenvalues, hardly anything off them."""
    rng = np.random.default_rng(0)
    free = rng.normal(size=(500, 3, 3))
    equal = np.linalg.qr(free)[0]
    sets = [
        free + free.transpose(0, 2, 1),
        np.eye(3) * rng.normal(size=(50, 1, 3)),
        np.zeros((1, 3, 3)),
        np.eye(3)[None],
        np.ones((1, 3, 3)),
        equal @ (np.array([2.0, 2.0, -1.0]) * np.eye(3)) @ equal.transpose(0, 2, 1),
        np.eye(3) + 1e-9 * (free + free.transpose(0, 2, 1)),
        1e-12 * (free + free.transpose(0, 2, 1)),
    ]
    C = np.concatenate(sets)
    N, d = decomposed(C, precision)
    exact = C.astype(np.float32).astype(float) if precision == "mixed" else C
    tolerance = 2e-6 if precision == "mixed" else 4e-15
    made = np.einsum("nik,nk,njk->nij", N, d, N)
    size = np.abs(exact).max(axis=(1, 2))
    assert np.abs(N.transpose(0, 2, 1) @ N - np.eye(3)).max() < tolerance
    assert (np.abs(made - exact).max(axis=(1, 2)) <= tolerance * size).all()
    values = np.sort(d, axis=1) - np.linalg.eigvalsh(exact)
    assert (np.abs(values).max(axis=1) <= tolerance * size).all()
