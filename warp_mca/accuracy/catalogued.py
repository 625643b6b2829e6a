"""Owns the question whether a scene is one of the catalogue as its parameters say."""

from __future__ import annotations

from dataclasses import replace

from warp_mca.scene import Scene
from warp_mca.scene.catalogue import SceneSource, load_source, scene_names


def source_of(scene: Scene, *, options: bool = False) -> SceneSource | None:
    """Where the scene comes from, if building it from its parameters gives it again; None otherwise.

    `refine` and `mass_scaling` may differ, which `warp_mca.run` may change.

    Args:
        scene: of the catalogue or not.
        options: the time step's scale and one formulation of all bodies may differ too, as commands have options for.
    """
    if scene.name not in scene_names():
        return None
    source = load_source(scene.name)
    if set(scene.parameters) != set(source.parameters):
        return None
    built = source.build(scene.parameters)
    if options and len({body.element for body in scene.bodies}) == 1:
        return source if like(built, scene) == scene else None
    impact = replace(built.impact, mass_scaling=scene.impact.mass_scaling)
    return source if replace(built, refine=scene.refine, impact=impact) == scene else None


def like(built: Scene, scene: Scene, scale: bool = True) -> Scene:
    """A scene that was built again, with what options of commands have changed in it: the size of its cells, elements,
    mass scaling and, with `scale`, the share of the stable time step.
    """
    own = scene.impact
    step = own.time_step_scale if scale else built.impact.time_step_scale
    impact = replace(built.impact, mass_scaling=own.mass_scaling, time_step_scale=step)
    elements = {body.name: body.element for body in scene.bodies}
    bodies = tuple(replace(body, element=elements.get(body.name, body.element)) for body in built.bodies)
    return replace(built, refine=scene.refine, impact=impact, bodies=bodies)
