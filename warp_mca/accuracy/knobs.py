"""Owns the plan of a trade-off: which values of which knobs it tries, one at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import Any

from warp_mca.accuracy.variant import Variant
from warp_mca.base.errors import RequestError
from warp_mca.physics.elements import ELEMENTS
from warp_mca.scene import Scene
from warp_mca.scene.catalogue import load_source, scene_names

# Values of each knob, the most informative first; a budget drops the last ones.
REFINE = (0.7, 1.4, 0.5, 1.2, 0.85)  # over the scene's own
PENALTY = (1.0, 3.0, 10.0, 0.3, 0.1, "auto")
MASS_SCALING = (2.0, 1.5, 3.0, 1.2)
MULTI_RATE = ("auto", 2)
TIME_STEP_SCALE = (0.7, 0.5, 0.95)

Parameters = Mapping[str, Any]

# Parameters that say how a scene of the catalogue is modelled, by the name of the knob. Those that say what it is
# (hinges, materials, friction) are no knobs.
MODELLING: dict[str, dict[str, Callable[[Parameters], Parameters]]] = {
    "two_link": {
        "far link coarser": lambda p: {"axial_OA": max(p["axial_OA"] // 2, 1)},
        "short plate, absorbing ends": lambda p: {
            "plate_absorbs": "ends",
            "plate_length": p["plate_width"],
            "plate_extension": 3,
        },
        "coarse rods, tied": lambda p: {"fine_length": 2.1 * p["radius"], "rod_section": 4, "rod_ring": 2},
        "far link rigid": lambda p: {"rigid_bodies": "OA"},
        "plate of tied boxes": lambda p: {"plate_mesh": "nested"},
        "finer contact": lambda p: {"focus_size": 0.7 * p["focus_size"], "focus_layers": p["focus_layers"] + 1},
    },
    "single_link": {
        "rod coarser along": lambda p: {"axial": max(p["axial"] // 2, 1)},
        "finer contact": lambda p: {"focus_size": 0.7 * p["focus_size"], "focus_layers": p["focus_layers"] + 1},
    },
    "three_link": {
        "rods coarser along": lambda p: {"axial": max(p["axial"] // 2, 1)},
        "far link rigid": lambda p: {"rigid_bodies": "OA"},
        "far links rigid": lambda p: {"rigid_bodies": "OA,AB"},
        "finer contact": lambda p: {"focus_size": 0.7 * p["focus_size"], "focus_layers": p["focus_layers"] + 1},
    },
    "hertz_sphere": {"finer contact": lambda p: {"pole_size": 0.7 * p["pole_size"]}},
    "rolling_sphere": {"finer contact": lambda p: {"pole_size": 0.7 * p["pole_size"]}},
}

# Knobs that a run refuses to turn together: tied and rigid bodies must keep their mass.
EXCLUDED = {"mass scaling": {"coarse rods, tied", "plate of tied boxes", "far link rigid", "far links rigid"}}


@dataclass(frozen=True)
class Trial:
    """A variant to run and its knob; variants of one knob exclude each other."""

    knob: str
    variant: Variant


BASE = Trial("as written", Variant())


def one_at_a_time(scene: Scene) -> list[Trial]:
    """Variants that change one knob of a scene; the first value of each knob, then the second of each, and so on."""
    knobs = {
        "mesh": [Variant(refine=scene.refine * factor) for factor in REFINE],
        "springs": list(_penalties(scene)),
        "mass scaling": [Variant(mass_scaling=factor) for factor in MASS_SCALING],
        "multi-rate": [Variant(multi_rate=groups) for groups in MULTI_RATE],
        "time step": [Variant(time_step_scale=scale) for scale in _scales(scene)],
        "element": [Variant(element=name) for name in _elements(scene)],
        "precision": [Variant(precision="float64")],
        **{knob: [Variant(parameters=changed)] for knob, changed in _modelling(scene).items()},
    }
    rows = zip_longest(*([Trial(knob, variant) for variant in found] for knob, found in knobs.items()))
    return [trial for row in rows for trial in row if trial is not None]


def penalty_of(scene: Scene) -> float | str | None:
    """The penalty that all contacts of a scene have in common; None where they differ, or have their default."""
    found = {contact.penalty for contact in scene.contacts}
    return found.pop() if len(found) == 1 else None


def _penalties(scene: Scene) -> Iterator[Variant]:
    if scene.contacts:
        yield from (Variant(penalty=value) for value in PENALTY if value != penalty_of(scene))


def _scales(scene: Scene) -> Iterator[float]:
    """Shares of the stable step [-]; a scene with a small one needs it, so that others are multiples of its own."""
    own = scene.impact.time_step_scale
    yield from (scale for scale in TIME_STEP_SCALE if scale != own) if own >= 0.5 else (0.7 * own, 1.4 * own, 0.5 * own)


def _elements(scene: Scene) -> list[str]:
    """Formulations that can replace the one that all bodies have."""
    found = {body.element for body in scene.bodies}
    own = ELEMENTS.get(str(found.pop())) if len(found) == 1 else None
    return [name for name, item in ELEMENTS.items() if own and item.cell == own.cell and item is not own]


def _modelling(scene: Scene) -> dict[str, Parameters]:
    """Values of modelling parameters by knob; none where the scene is not what the catalogue builds.

    Its cells may be finer or coarser.
    """
    if scene.name not in MODELLING or scene.name not in scene_names():
        return {}
    try:
        built = load_source(scene.name).build(scene.parameters)
    except RequestError:
        return {}
    if replace(built, parameters={}, refine=scene.refine) != replace(scene, parameters={}):
        return {}
    made = {knob: change(scene.parameters) for knob, change in MODELLING[scene.name].items()}
    return {
        knob: changed
        for knob, changed in made.items()
        if any(scene.parameters[key] != value for key, value in changed.items())
    }
