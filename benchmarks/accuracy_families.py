"""Owns the families of scenes that the store of accuracies is measured on: their ranges, variants and references."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from warp_mca.accuracy.variant import Variant
from warp_mca.scene.catalogue import load_source

Values = dict[str, Any]

PEAK_OF_FLAT_ENDS = "flat ends meet at once: the force overshoots its plateau, and higher and shorter as cells shrink"
ROLLS_ON = "a sphere that rolls stays in contact"
PEAK_OF_BOUNCES = "the sphere is pressed from the start: its first peak is a bounce that small cells shorten"

# Duration of contact [s] at 0.7, 70 and 7000 GPa of the tip, the rods' cylinders, or both (paper, Table 3, Fig. 16-18).
DURATIONS = {
    "tip": (1.0e-3, 0.42e-3, 0.33e-3),
    "body": (1.39e-3, 0.42e-3, 0.22e-3),
    "whole": (1.57e-3, 0.42e-3, 0.14e-3),
}
SPANS = (0.3e-3, 0.6e-3, 1.0e-3, 1.6e-3, 2.1e-3)  # simulated [s]: scenes of equal span are batched


@dataclass(frozen=True, kw_only=True)
class Reference:
    """From which runs of a scene the limits of its figures are extrapolated.

    Attributes:
        fine: variant of the finest mesh.
        partner: number of the variant with which it is extrapolated.
        between: number of a variant whose mesh lies between these two.
        order: of the extrapolation [-].
    """

    fine: Variant
    partner: int
    between: int
    order: float


ClosedForm = Callable[[Values], tuple[float | None, ...]]  # limits of the figures of a scene, None where one has none


@dataclass(frozen=True, kw_only=True)
class Family:
    """Scenes of one kind.

    Attributes:
        scene: of the catalogue.
        features: parameters in which scenes differ, "log" or "linear".
        mesh: parameters that say how the scene is modelled; variants set all of them.
        any_value: other parameters whose value does not matter, or that variants leave as they are.
        fixed: parameters of all scenes that are measured.
        no_limit: figures that have no limit, with the reason.
        variants: from which to choose.
        limits: how they are found.
        sample: parameters of a random scene.
    """

    scene: str
    features: Mapping[str, str]
    mesh: tuple[str, ...]
    any_value: tuple[str, ...] = ()
    fixed: Mapping[str, Any]
    no_limit: Mapping[str, str]
    variants: tuple[Variant, ...]
    limits: Reference | ClosedForm
    sample: Callable[[random.Random], Values]

    def base(self) -> Values:
        """Values of the mesh parameters that variants start from: those of the scene's first preset."""
        values = load_source(self.scene).resolve(None)
        return {name: values[name] for name in self.mesh}


def _digits(value: float) -> float:
    return float(f"{value:.4g}")


def _between(rng: random.Random, low: float, high: float) -> float:
    """Uniform on a logarithmic scale."""
    return _digits(math.exp(rng.uniform(math.log(low), math.log(high))))


def _links(
    refine: float,
    axial: int,
    penalty: float,
    mass_scaling: float | None = 1.5,
    element: str | None = None,
    finer: float = 1.0,
) -> Variant:
    """`two_link` with so many cells along OA after refinement, and as long ones along AB.

    `finer`: how many times smaller cells are at the contact, over the same patch, than `refine` alone makes them [-].
    """
    cells = {"axial_OA": max(1, round(axial / refine)), "axial_AB": max(1, round(axial * 15 / 16 / refine))}
    return Variant(
        refine=refine,
        mass_scaling=mass_scaling,
        element=element,
        multi_rate="auto",
        parameters={"penalty": penalty, **cells, **(_patch(finer) if finer != 1.0 else {})},
    )


def _patch(finer: float) -> Values:
    """Mesh of tip and plate at the contact, with cells so many times smaller than those of `quick` [-]."""
    return {
        "focus_size": 0.6e-3 / finer,
        "focus_layers": round(4 * math.sqrt(finer)),
        "plate_core_x": 2 * round(5 * finer),
        "plate_core_z": 2 * round(3 * finer),
        "plate_core_depth": round(3 * finer),
        "plate_layers": round(8 * finer**0.33),
    }


def _two_link(rng: random.Random) -> Values:
    """Friction, speed of the plate, height, radius, and moduli of tip, cylinders or both as in the paper's Table 3."""
    values: Values = {
        "mu": round(rng.uniform(0.1, 1.5), 3),
        "v_plate": rng.choice([0.0, round(rng.uniform(0.4, 4.0), 3)]),
        "H": round(rng.uniform(0.33, 0.40), 4),
        "radius": round(rng.uniform(0.011, 0.016), 5),
    }
    kind, span = rng.choice(["none", "tip", "body", "whole"]), 0.42e-3
    if kind != "none":
        x = rng.uniform(-2.0, 2.0)
        soft, middle, stiff = DURATIONS[kind]
        span = middle * ((soft if x < 0.0 else stiff) / middle) ** abs(x / 2.0)
        for part in ("tip", "body"):
            if kind in (part, "whole"):
                values |= {f"E_{part}": _digits(70e9 * 10.0**x), f"E_t_{part}": _digits(27e9 * 10.0**x)}
    return {**values, "duration": next(item for item in SPANS if item >= 1.3 * span or item == SPANS[-1])}


def _axial(refine: float, axial: int, penalty: float, mass_scaling: float | None = 1.5) -> Variant:
    cells = {"axial": max(1, round(axial / refine))}
    return Variant(
        refine=refine, mass_scaling=mass_scaling, multi_rate="auto", parameters={"penalty": penalty, **cells}
    )


def _plain(refine: float, penalty: float) -> Variant:
    return Variant(refine=refine, multi_rate="auto", parameters={"penalty": penalty})


RODS = ("section", "ring", "focus_size", "focus_layers", "plate_core_depth", "plate_layers", "plate_extension")
REFINES = (0.5, 0.7, 1.0, 1.4, 2.0, 2.8)
ALONG = ((0.7, 80), (0.7, 112), (1.0, 80), (1.0, 112), (1.0, 160), (1.4, 160))
BETWEEN = (0.6, 0.85, 1.2, 1.7, 2.4)
# Softer springs hold flat ends too long.
FLAT = (_plain(0.5, 1.0), *(_plain(refine, 3.0) for refine in (*REFINES, *BETWEEN)))
# With more cells along rods than across them.
FLAT += tuple(_axial(refine, axial, 3.0, None) for refine, axial in ALONG)


def _coaxial(values: Values) -> tuple[float | None, ...]:
    """Impulse [N s] and duration [s] of rods of equal section: all momentum of the short one, two transits of its wave.

    Without Poisson effect waves are one-dimensional (Goldsmith, Impact, 2.2).
    """
    known = {**load_source("coaxial_rods").resolve(None), **values}
    mass = known["rho"] * known["side"] ** 2 * known["length"]
    return None, mass * known["v"], 2.0 * known["length"] / math.sqrt(known["E"] / known["rho"])


FAMILIES = (
    Family(
        scene="two_link",
        features={
            **{f"{name}_{part}": "log" for name in ("E", "E_t") for part in ("tip", "body")},
            "radius": "linear",
            "H": "linear",
            "mu": "linear",
            "v_plate": "linear",
        },
        mesh=(
            *("axial_OA", "axial_AB", "axial_ratio", "plate_core_x", "plate_core_z", "plate_mesh", "fine_length"),
            *("rod_section", "rod_ring", *RODS),
        ),
        any_value=("joint_nodes", "pin_radius"),
        fixed={"joint_nodes": "pin"},
        no_limit={},
        variants=(
            _links(1 / 2, 20, 1.0),
            _links(1 / 2, 28, 3.0),
            _links(2 / 3, 20, 1.0),
            _links(2 / 3, 28, 1.0),
            _links(2 / 3, 42, 3.0),
            _links(1.0, 20, 1.0),
            _links(1.0, 28, 1.0),
            _links(1.0, 28, 1.0, 2.0),
            _links(1.0, 42, 2.0),
            _links(4 / 3, 42, 1.0),
            _links(4 / 3, 56, 2.0),
            _links(5 / 3, 56, 2.0),
            _links(2.0, 64, 2.0),
            _links(1 / 2, 20, 1.0, 2.0),
            _links(2 / 3, 28, 1.0, 2.0),
            _links(2 / 3, 28, 1.0, 1.5, "hex8r"),
            _links(1.0, 28, 1.0, 1.5, "hex8r"),
            _links(4 / 3, 42, 1.0, 1.5, "hex8r"),
            _links(1.0, 42, 1.5, 2.2),
            _links(1.0, 42, 1.5, 2.4),
            _links(1.0, 42, 2.0, 2.0),
            _links(4 / 3, 42, 2.0, 2.2),
            _links(4 / 3, 42, 3.0, 2.2),
            _links(5 / 3, 56, 2.0, 2.2),
            _links(2.0, 64, 2.0, 2.0),
            _links(1.0, 42, 2.0, 3.0, finer=1.5),
            _links(4 / 3, 42, 2.0, 3.0, finer=1.25),
            _links(4 / 3, 42, 2.0, 3.0, finer=1.5),
            _links(4 / 3, 42, 2.0, 2.6, finer=1.25),
            _links(4 / 3, 42, 2.0, 2.6, finer=1.125),
        ),
        limits=Reference(fine=_links(3.0, 72, 3.0, None), partner=10, between=12, order=2.0),
        sample=_two_link,
    ),
    Family(
        scene="single_link",
        features={"radius": "linear", "H": "linear", "mu": "linear"},
        mesh=("axial", "plate_core", *RODS),
        any_value=("joint_nodes", "pin_radius"),
        fixed={"joint_nodes": "pin"},
        no_limit={},
        variants=(
            _axial(0.5, 16, 1.0),
            _axial(1.0, 16, 1.0),
            _axial(1.0, 28, 2.0),
            _axial(1.5, 28, 1.0),
            _axial(1.5, 42, 2.0),
            _axial(2.0, 42, 2.0),
            _axial(2.5, 56, 2.0, None),
            _axial(1.0, 28, 2.0, 2.2),
            _axial(1.5, 42, 2.0, 2.2),
            _axial(2.0, 42, 2.0, 2.2),
        ),
        limits=Reference(fine=_axial(4.0, 72, 3.0, None), partner=5, between=6, order=2.0),
        sample=lambda rng: {
            "mu": round(rng.uniform(0.1, 1.0), 3),
            "H": round(rng.uniform(0.12, 0.18), 4),
            "radius": round(rng.uniform(0.011, 0.016), 5),
        },
    ),
    Family(
        scene="hertz_sphere",
        features={"v": "log", "E_ratio": "log", "nu": "linear"},
        mesh=("section", "pole_size", "pole_layers"),
        fixed={},
        no_limit={},
        variants=tuple(_plain(refine, 10.0) for refine in REFINES),
        limits=Reference(fine=_plain(4.0, 10.0), partner=4, between=5, order=1.5),
        sample=lambda rng: {
            "v": _between(rng, 0.5, 2.0),
            "E_ratio": _between(rng, 0.5, 2.0),
            "nu": round(rng.uniform(0.2, 0.35), 3),
        },
    ),
    Family(
        scene="rolling_sphere",
        features={"v": "log", "mu": "linear"},
        mesh=("section", "pole_size", "pole_layers"),
        fixed={},
        no_limit={"F_n_first_peak": PEAK_OF_BOUNCES, "contact_duration": ROLLS_ON},
        variants=tuple(_plain(refine, 1.0) for refine in REFINES),
        limits=Reference(fine=_plain(4.0, 1.0), partner=4, between=5, order=1.5),
        sample=lambda rng: {"v": _between(rng, 7.0, 13.0), "mu": round(rng.uniform(0.2, 0.4), 3)},
    ),
    Family(
        scene="rod_on_wall",
        features={"v": "log", "length": "log", "nu": "linear"},
        mesh=("axial", "section"),
        fixed={},
        no_limit={"F_n_first_peak": PEAK_OF_FLAT_ENDS},
        variants=FLAT,
        limits=Reference(fine=_plain(4.0, 3.0), partner=4, between=6, order=1.0),
        sample=lambda rng: {
            "v": _between(rng, 0.5, 4.0),
            "length": _between(rng, 1.2, 3.0),
            "nu": round(rng.uniform(0.0, 0.3), 2),
        },
    ),
    Family(
        scene="coaxial_rods",
        features={"v": "log", "length": "log", "ratio": "log"},
        mesh=("axial", "section"),
        fixed={},
        no_limit={"F_n_first_peak": PEAK_OF_FLAT_ENDS},
        variants=FLAT + tuple(_axial(1.0, axial, 3.0, None) for axial in (240, 360)),
        limits=_coaxial,
        sample=lambda rng: {
            "v": _between(rng, 1.0, 4.0),
            "length": _between(rng, 0.3, 0.8),
            "ratio": _between(rng, 1.5, 3.0),
        },
    ),
)
