"""Owns static cases of ideal plasticity: the plastic moment, a thick tube, upsetting between rough plates."""

from __future__ import annotations

import math

import numpy as np

import warp_mca as mca
from warp_mca.verify.case import Row, Setup, case, every, share_row
from warp_mca.verify.small_meshes import Array, brick
from warp_mca.verify.statics import Kinematics, Statics

SIGMA_Y = 1e-6  # yield stress [Pa] with E = 1 Pa: strains remain small at any multiple
METAL = mca.J2Bilinear(E=1.0, nu=0.3, rho=1.0, sigma_y=SIGMA_Y, E_t=0.0)
UPSET = 1.045  # mean pressure over the yield stress when the cube is shortened by ten times its elastic limit, +-.003

# What errors of elements other than the default may be.
MOMENT = {
    "hex8": (0.02, 0.31),
    "hex8r": (6.5, 0.36),
    "hex8w": (0.02, 0.02),
    "hex8w3": (0.02, 0.02),
    "tet4": (1.3, 0.78),
    "tet10": (0.075, 0.035),
    "tet10_mean": (0.25, 0.02),
    "wedge6": (0.2, 0.035),
}
TUBE = {"hex8r": (0.053, 0.013), "tet4": (0.086, 0.018), "wedge6": (0.49, 0.12)}
UPSETTING = {"hex8": (0.036, 0.016), "hex8r": (0.11, 0.051), "tet4": (0.072, 0.025), "wedge6": (0.025, 0.015)}


def moment(setup: Setup, layers: int, kinematics: Kinematics = "corotational") -> float:
    """Error of the plastic moment of a beam, one cell long, bent to ten times the curvature at which it yields [-].

    Args:
        setup: with the element.
        layers: of cells over the thickness.
        kinematics: of the body.
    """
    statics = Statics(setup, brick(setup.element, (1, 1, layers), (1.0, 1.0, 1.0)), METAL, kinematics=kinematics)
    x, y, z = statics.body.X.T
    near, far = x < 1e-9, x > 1.0 - 1e-9
    held = np.stack([near | far, y < 1e-9, near & (z < 1e-9)], axis=1)
    force = statics.drive(held, np.outer(far * 20.0 * SIGMA_Y * (z - 0.5), [1.0, 0.0, 0.0]))
    return float(force[far, 0] @ (z[far] - 0.5) / (SIGMA_Y / 4.0) - 1.0)


def polar(X: Array) -> Array:
    """Axes along the radius, around and along z at positions [m], the columns of matrices, shape (node_count, 3, 3)."""
    cosine, sine = (X[:, :2] / np.hypot(X[:, 0], X[:, 1])[:, None]).T
    zero, one = np.zeros(len(X)), np.ones(len(X))
    return np.stack([cosine, -sine, zero, sine, cosine, zero, zero, zero, one], axis=1).reshape(-1, 3, 3)


def tube(setup: Setup, count: int) -> float:
    """Error of the pressure under which a tube of radii 1 m and 2 m yields throughout, in plane strain [-].

    Args:
        setup: with the element.
        count: cells over the wall, of a sector of 5 degrees.
    """
    angle, width = math.radians(5.0), 0.1

    def move(x: Array) -> Array:
        r, phi = 2.0 ** x[:, 0], angle * (x[:, 1] - 0.5)
        return np.stack([r * np.cos(phi), r * np.sin(phi), width * x[:, 2]], axis=1)

    statics = Statics(setup, brick(setup.element, (count, 1, 1), (1.0, 1.0, 1.0), move), METAL, polar)
    bore = np.hypot(*statics.body.X[:, :2].T) < 1.0 + 1e-9
    held = np.stack([bore, np.ones_like(bore), np.ones_like(bore)], axis=1)
    force = statics.drive(held, np.outer(bore, [10.0 * SIGMA_Y, 0.0, 0.0]))
    pressure = force[bore, 0].sum() / (2.0 * math.sin(0.5 * angle) * width)
    return float(pressure / (2.0 / math.sqrt(3.0) * SIGMA_Y * math.log(2.0)) - 1.0)


def upsetting(setup: Setup, count: int) -> float:
    """Error of the mean pressure on a cube that rough plates shorten by ten times its elastic limit [-].

    Args:
        setup: with the element.
        count: cells along half an edge; an eighth of the cube is meshed.
    """
    statics = Statics(setup, brick(setup.element, (count, count, count), (0.5, 0.5, 0.5)), METAL)
    top = statics.body.X[:, 2] > 0.5 - 1e-9
    held = (statics.body.X < 1e-9) | top[:, None]
    force = statics.drive(held, np.outer(top, [0.0, 0.0, -5.0 * SIGMA_Y]))
    return float(-force[top, 2].sum() / 0.25 / SIGMA_Y / UPSET - 1.0)


@case(
    group="elements",
    title="A beam bent far beyond yield carries its plastic moment",
    reference="sigma_y b h^2 / 4, ideal plasticity.",
    elements=every(),
)
def plastic_moment(setup: Setup) -> list[Row]:
    """One cell long, one and two layers, bent to ten times the curvature at which it yields."""
    allowed = setup.by_element((0.17, 0.02), **MOMENT)
    why = "two points over the thickness of one layer give 2 / sqrt(3) of the moment; else as measured, and a tenth"
    rows = [
        share_row(f"moment over exact, layers: {layers}", moment(setup, layers), most, why)
        for layers, most in zip((1, 2), allowed, strict=True)
    ]
    finite = moment(setup, 2, "finite")
    return [*rows, share_row("moment over exact, layers: 2, finite strain", finite, allowed[1], why)]


@case(
    group="elements",
    title="A thick tube yields throughout at its limit of pressure",
    reference="2 / sqrt(3) sigma_y ln(b / a) in plane strain (Hill, The Mathematical Theory of Plasticity, 1950).",
    elements=every(),
)
def thick_tube(setup: Setup) -> list[Row]:
    """b / a = 2, two and four cells over the wall, the bore widened by ten times sigma_y a / E."""
    allowed = setup.by_element((0.025, 0.006), **TUBE)
    return [
        share_row(f"pressure over exact, {count} cells", tube(setup, count), most, "error of the mesh, and a tenth")
        for count, most in zip((2, 4), allowed, strict=True)
    ]


@case(
    group="elements",
    title="A cube upset between rough plates resists as it must",
    reference="Mean pressure 1.045 +- 0.003 of the yield stress, from 2 to 8 cells along half an edge.",
    elements=every(),
)
def upset_cube(setup: Setup) -> list[Row]:
    """Two and four cells along half an edge, shortened by ten times its elastic limit, ideal plasticity."""
    allowed = setup.by_element((0.025, 0.01), **UPSETTING)
    return [
        share_row(f"pressure over the reference, {count} cells", upsetting(setup, count), most, "error of the mesh")
        for count, most in zip((2, 4), allowed, strict=True)
    ]
