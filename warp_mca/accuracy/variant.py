"""Owns what may be changed in a scene's model to spend less or more, as one value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

from warp_mca.accuracy.catalogued import like
from warp_mca.scene import Scene
from warp_mca.scene.catalogue import load_source
from warp_mca.scene.options import with_options


@dataclass(frozen=True, kw_only=True)
class Variant:
    """A model of a scene: what differs from the scene as its user wrote it. None leaves a thing as it is.

    Attributes:
        refine: as in `Scene` [-].
        penalty: of all contacts, as in `Contact`.
        mass_scaling: as in `ImpactPhase`.
        time_step_scale: share of the stable step [-].
        element: formulation of all bodies.
        precision: "mixed" or "float64".
        multi_rate: as in `warp_mca.run`.
        parameters: of a scene of the catalogue, that say how it is modelled (not what it is).
    """

    refine: float | None = None
    penalty: float | str | None = None
    mass_scaling: float | str | None = None
    time_step_scale: float | None = None
    element: str | None = None
    precision: str | None = None
    multi_rate: int | str | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)

    @property
    def knobs(self) -> dict[str, Any]:
        """What it changes, by name."""
        own = {item.name: getattr(self, item.name) for item in fields(self) if item.name != "parameters"}
        return {**{name: value for name, value in own.items() if value is not None}, **self.parameters}

    @property
    def options(self) -> dict[str, Any]:
        """Arguments of `warp_mca.run` that it asks for."""
        named = {"precision": self.precision, "multi_rate": self.multi_rate}
        return {name: value for name, value in named.items() if value is not None}

    def applied(self, scene: Scene) -> Scene:
        """The scene as this variant models it.

        Raises:
            RequestError: a value is not allowed in this scene.
        """
        if self.parameters:
            built = load_source(scene.name).build({**scene.parameters, **self.parameters})
            scene = like(built, scene, scale="time_step_scale" not in self.parameters)
        scene = with_options(scene, self.refine, self.mass_scaling, None)
        if self.penalty is not None:
            scene = replace(scene, contacts=tuple(replace(item, penalty=self.penalty) for item in scene.contacts))
        if self.element is not None:
            scene = replace(scene, bodies=tuple(replace(body, element=self.element) for body in scene.bodies))
        if self.time_step_scale is not None:
            scene = replace(scene, impact=replace(scene.impact, time_step_scale=self.time_step_scale))
        return scene
