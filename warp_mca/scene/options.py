"""Owns what a run or a command may change in a scene: the size of its cells, and what mass scaling it takes."""

from __future__ import annotations

from dataclasses import replace

from warp_mca.base.errors import bad_value
from warp_mca.scene.scene import Scene


def with_options(scene: Scene, refine: float | None, mass_scaling: float | str | None, meshes: object) -> Scene:
    """The scene with `Scene.refine` and `ImpactPhase.mass_scaling` replaced, unless that is None.

    Raises:
        RequestError: a value is not allowed, or `meshes` are given that `refine` would not change.
    """
    if mass_scaling is not None:
        scene = replace(scene, impact=replace(scene.impact, mass_scaling=mass_scaling))
    if refine is None:
        return scene
    if meshes is not None:
        raise bad_value("refine", refine, "finished meshes are given, which it cannot change; leave one of the two out")
    return replace(scene, refine=refine)
