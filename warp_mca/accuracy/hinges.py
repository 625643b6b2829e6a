"""Owns which figures of a scene have no limit as its mesh is refined, because of the joints that it has."""

from __future__ import annotations

from collections.abc import Mapping

from warp_mca.scene import Revolute, Scene, Spherical

# Figures that depend on the reaction of a joint; the first force peak is over before.
AFTER = ("impulse", "contact_duration", "max_plastic_strain")


def without_limit(scene: Scene) -> Mapping[str, str]:
    """Reasons by figure why it has no limit; none where all joints join areas or volumes.

    A force at a point or along a line gives displacements that grow without bound as cells shrink, as 1/h and ln 1/h
    (Kelvin's and Flamant's solutions), and plastic strain with them.
    """
    for joint in scene.acting_joints:
        if isinstance(joint, Revolute) and joint.nodes != "pin":
            what = "two nodes" if joint.nodes == "ends" else "the nodes of its axis"
            load = "a point load" if joint.nodes == "ends" else "a line load"
            why = f'hinge {joint.name} ties {what}, {load} that yields more as cells shrink; nodes="pin" has a limit'
            return dict.fromkeys(AFTER, why)
        if isinstance(joint, Spherical):
            return dict.fromkeys(AFTER, f"joint {joint.name} ties single nodes, a point load that has no limit")
    return {}
