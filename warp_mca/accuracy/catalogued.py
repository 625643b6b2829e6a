"""Owns the question whether a scene is one of the catalogue as its parameters say."""

from __future__ import annotations

from dataclasses import replace

from warp_mca.scene import Scene
from warp_mca.scene.catalogue import SceneSource, load_source, scene_names


def source_of(scene: Scene) -> SceneSource | None:
    """Where the scene comes from, if building it from its parameters gives it again; None otherwise.

    `refine` and `mass_scaling` may differ, which are options of a run.
    """
    if scene.name not in scene_names():
        return None
    source = load_source(scene.name)
    if set(scene.parameters) != set(source.parameters):
        return None
    built = source.build(scene.parameters)
    impact = replace(built.impact, mass_scaling=scene.impact.mass_scaling)
    return source if replace(built, refine=scene.refine, impact=impact) == scene else None
