"""Owns the store of measured runs: for families of scenes, variants of the model and the errors that each has made.

The package has a file of its own; users add theirs, of the same form, to a folder (`user_folder`). Nothing is written
there by a run, so that what a run chooses depends on these files and the scene alone. The format stands in
docs/measurements/accuracy.md.
"""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.accuracy.catalogued import source_of
from warp_mca.accuracy.figures import BOUND, bound_errors
from warp_mca.accuracy.variant import Variant
from warp_mca.base.errors import bad_value
from warp_mca.scene import Scene
from warp_mca.scene.catalogue import load_source

OWN = Path(__file__).with_name("store.json")
IGNORED = frozenset({"duration", "output_interval", "time_step_scale", "penalty"})  # of a family's parameters


@dataclass(frozen=True)
class Size:
    """What a variant takes, as means over the scenes of a family.

    Attributes:
        elements: of its mesh [-].
        steps: as long as the smallest element asks for, in the whole run [-].
        computed: elements that a step computes on a CPU with steps of several rates, as a share [-].
    """

    elements: float
    steps: float
    computed: float


@dataclass(frozen=True)
class Measured:
    """A scene of a family with the errors of its variants.

    Attributes:
        parameters: that differ from the scene's defaults.
        errors: signed, by variant and figure [-]; None where a run has no such figure.
        left: uncertainty of the limits to which errors refer, by figure [-]; None if unknown.
    """

    parameters: Mapping[str, Any]
    errors: Mapping[int, Mapping[str, float | None]]
    left: Mapping[str, float | None] = field(default_factory=dict)


@dataclass(frozen=True)
class Process:
    """How the errors of one figure of one variant depend on the features, learned from the scenes of a family.

    Attributes:
        length: over which they are alike, in standard deviations of the features [-].
        core: standard deviation of most errors over that of all [-]: a few large ones widen the latter.
    """

    length: float
    core: float


@dataclass(frozen=True)
class Family:
    """Scenes of one kind that have been measured.

    Attributes:
        scene: its name in the catalogue.
        features: parameters in which the scenes differ, each "log" or "linear".
        defaults: values of these where a scene does not name them.
        mesh: parameters of the scene that say how it is modelled, with values that variants start from.
        any_value: parameters that do not matter to errors, or only to those of figures without a limit.
        no_limit: figures without a limit, with the reason.
        variants: from which to choose.
        sizes: of each variant.
        scenes: measured.
        processes: by figure and number of the variant, None where too few scenes tell; figures that are not here are
            fitted when they are needed, which takes half a second for a hundred scenes and thirty variants.
    """

    scene: str
    features: Mapping[str, str]
    defaults: Mapping[str, Any]
    mesh: Mapping[str, Any]
    any_value: tuple[str, ...]
    no_limit: Mapping[str, str]
    variants: tuple[Variant, ...]
    sizes: tuple[Size, ...]
    scenes: tuple[Measured, ...]
    processes: Mapping[str, tuple[Process | None, ...]] = field(default_factory=dict)

    @cached_property
    def points(self) -> NDArray[np.float64]:
        """Features of the measured scenes [-], shape (scene_count, feature_count)."""
        return np.array([self.coordinates(scene.parameters) for scene in self.scenes])

    @cached_property
    def scale(self) -> NDArray[np.float64]:
        """Standard deviations of the features [-], shape (feature_count,)."""
        return np.maximum(self.points.std(axis=0), 1e-12 + 1e-3 * np.abs(self.points).max(axis=0))

    @cached_property
    def errors(self) -> dict[str, NDArray[np.float64]]:
        """Errors by figure [-], shape (scene_count, variant_count); nan where no run has such a figure."""
        found = {figure: np.full((len(self.scenes), len(self.variants)), np.nan) for figure in BOUND}
        for k, scene in enumerate(self.scenes):
            for number, errors in scene.errors.items():
                for figure, error in errors.items():
                    found[figure][k, number] = np.nan if error is None else error
        return found

    @cached_property
    def left(self) -> dict[str, NDArray[np.float64]]:
        """Uncertainty of the limits by figure [-], shape (scene_count,); 0 if unknown."""
        return {figure: np.array([scene.left.get(figure) or 0.0 for scene in self.scenes]) for figure in BOUND}

    def coordinates(self, parameters: Mapping[str, Any]) -> list[float]:
        """Features of a scene of the family [-], logarithms of those that are "log"."""
        values = {name: float(parameters.get(name, self.defaults[name])) for name in self.features}
        return [math.log(values[name]) if kind == "log" else values[name] for name, kind in self.features.items()]


def user_folder() -> Path:
    """Folder of the user's own measurements; it need not exist."""
    home = Path.home() / ("Library/Caches" if sys.platform == "darwin" else ".cache")
    return Path(os.environ.get("XDG_CACHE_HOME") or home) / "warp_mca" / "accuracy"


def families() -> dict[str, Family]:
    """Families by the name of their scene; scenes of the user's files are added to those of the package.

    Raises:
        RequestError: a file of the user cannot be read.
    """
    found = dict(_own())
    for path in sorted(user_folder().glob("*.json")):
        for name, family in _read(path).items():
            known = found.get(name)
            same = known is not None and (known.variants, known.features) == (family.variants, family.features)
            found[name] = replace(known, scenes=known.scenes + family.scenes) if known and same else family
    return found


def family_of(scene: Scene) -> Family | None:
    """The family of a scene: made by the catalogue as it stands, with other values in parameters of the family only."""
    family, source = families().get(scene.name), source_of(scene)
    if family is None or source is None:
        return None
    free = {*family.features, *family.mesh, *family.any_value, *IGNORED}
    others = [name for name in source.parameters if name not in free]
    plain = all(scene.parameters[name] == source.parameters[name].default for name in others)
    return family if plain else None


def no_limit_of(scene: Scene) -> Mapping[str, str]:
    """Figures without a limit of a scene of the catalogue, whatever its parameters, with the reason."""
    family = families().get(scene.name)
    return family.no_limit if family is not None and source_of(scene, options=True) is not None else {}


@lru_cache(maxsize=1)
def _own() -> dict[str, Family]:
    return _read(OWN)


def _read(path: Path) -> dict[str, Family]:
    """Families of a file.

    Raises:
        RequestError: it is not of the store's form.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        return {name: family_from(name, item) for name, item in data["families"].items()}
    except (OSError, ValueError, KeyError, TypeError, IndexError) as error:
        remedy = f"it cannot be read as measurements ({type(error).__name__}: {error}); correct or remove it"
        raise bad_value("file of the accuracy store", str(path), remedy) from error


def family_from(name: str, data: Mapping[str, Any]) -> Family:
    """The family that a file of the store describes."""
    mesh = data["mesh"]
    variants = tuple(
        Variant(**{**item, "parameters": {**mesh, **item.get("parameters", {})}}) for item in data["variants"]
    )
    scenes = tuple(
        Measured(
            item["parameters"],
            {run["variant"]: bound_errors(run["errors"], data["no_limit"]) for run in item["runs"]},
            dict(zip(BOUND, item.get("left", ()), strict=False)),
        )
        for item in data["scenes"]
    )
    return Family(
        scene=name,
        features=data["features"],
        defaults={key: item.default for key, item in load_source(name).parameters.items() if key in data["features"]},
        mesh=mesh,
        any_value=tuple(data["any_value"]),
        no_limit=data["no_limit"],
        variants=variants,
        sizes=_sizes(len(variants), data["scenes"]),
        scenes=scenes,
        processes={
            figure: tuple(None if item is None else Process(*item) for item, _ in zip(items, variants, strict=True))
            for figure, items in data.get("processes", {}).items()
        },
    )


def _sizes(count: int, scenes: Any) -> tuple[Size, ...]:
    """Mean sizes; steps relative to those of the first variant in the same scene, times its mean; 0 where unknown."""
    rows = [{run["variant"]: run for run in item["runs"] if "elements" in run} for item in scenes]
    rows = [row for row in rows if 0 in row]
    first = sum(row[0]["steps"] for row in rows) / max(len(rows), 1)

    def mean(k: int, value: Any) -> float:
        found = [value(row[k], row[0]) for row in rows if k in row]
        return sum(found) / max(len(found), 1)

    return tuple(
        Size(
            elements=mean(k, lambda run, _: run["elements"]),
            steps=first * mean(k, lambda run, zero: run["steps"] / zero["steps"]),
            computed=mean(k, lambda run, _: run["computed"]),
        )
        for k in range(count)
    )
