"""Owns bodies: geometry, material, element and initial motion."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.base.rotation import rotation_matrix
from warp_mca.geometry.mass_properties import HEAVIEST, LIGHTEST, Matrix, inertia_matrix
from warp_mca.scene.elastic import Elastic
from warp_mca.scene.elements import ELEMENTS
from warp_mca.scene.materials import MATERIALS, Material, check_law

if TYPE_CHECKING:
    from warp_mca.geometry.mesh import Mesh
    from warp_mca.geometry.recipe import Recipe
    from warp_mca.scene.contacts import RigidPlane

Vec3 = tuple[float, float, float]
STEEL = Elastic(E=2.1e11, nu=0.3, rho=7800.0)  # of rigid bodies whose material is not given


@dataclass(frozen=True, kw_only=True)
class Body:
    """A deformable body, or a rigid one.

    Attributes:
        name: unique in the scene.
        geometry: a recipe that makes the mesh when it is needed, or a finished mesh, in the body's own frame. A rigid
            body with a mass of its own may go without: it is then drawn as the brick of its inertia, and touches
            nothing.
        material: one material, or one for each cell set of the mesh; the key "*" stands for the other cells. A rigid
            body with a mass of its own may go without: contact springs then take it as stiff as steel.
        element: formulation of its hexahedra, wedges and pyramids: "hex8i" bends right with one cell over a wall;
            "hex8", the paper's, does not; "hex8r", the cheapest, has one point and hourglass stiffness. For walls of
            one cell that yield, "hex8w" has two points in each half of the thickness, "hex8w3" three. "tet4", "tet10"
            and "tet10_mean" cut all cells to tetrahedra of four or ten nodes, and "tet4" takes the corners of ten-node
            ones. "wedge6" computes wedges alone. In bodies of other elements tetrahedra are tet4 and tet10, and wedges
            are wedge6 unless hex8 or hex8r is named.
        across: direction through the wall in the body's frame [-], for "hex8w" and "hex8w3"; None: found from the mesh,
            as the cells lie on the surface.
        kinematics: "corotational" takes strains as small, in the rotated frame; "finite" as logarithmic, for large
            plastic deformation.
        position: of the body frame's origin [m].
        rotation: of the body frame, as a rotation vector [rad].
        velocity: initial velocity of the body frame's origin [m/s].
        angular_velocity: initial angular velocity about the body frame's origin [rad/s].
        rigid: whether it moves as a rigid body in the impact phase: its elements are not computed, and `material` gives
            its mass and the stiffness of contact springs alone. Its inertia is that of its nodes: for a brick of n
            cells along each edge 2 / n^2 above that of its volume.
        mass: of a rigid body, in place of that of its mesh [kg]; with it `inertia` is given.
        centre: of this mass in the body's frame [m].
        inertia: of this mass about the centre, along the axes of the body's frame [kg m^2]: three rows of a 3 x 3
            matrix, or three principal values.
        exact_mass: whether masses of nodes are scaled to the volume of the shape that the recipe or CAD file describes,
            where the mesh knows it (`Mesh.volume_ratio`): flat cells fill a round body less than fully. Momentum,
            impulse, weight and moments of inertia then scale alike; waves are slower by half of the share. False: the
            mass of the cells.
    """

    name: str
    geometry: Recipe | Mesh = None  # pyright: ignore[reportAssignmentType]  # a body with a mass gets its brick
    material: Material | Mapping[str, Material] = None  # pyright: ignore[reportAssignmentType]  # likewise, STEEL
    element: str = "hex8i"
    kinematics: Literal["corotational", "finite"] = "corotational"
    position: Vec3 = (0.0, 0.0, 0.0)
    rotation: Vec3 = (0.0, 0.0, 0.0)
    velocity: Vec3 = (0.0, 0.0, 0.0)
    angular_velocity: Vec3 = (0.0, 0.0, 0.0)
    rigid: bool = False
    exact_mass: bool = True
    across: Vec3 | None = None
    mass: float | None = None
    centre: Vec3 = (0.0, 0.0, 0.0)
    inertia: Vec3 | Matrix | None = None

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts("Body", name=self.name)
        self._check_mass()
        if isinstance(self.geometry, type) or not (hasattr(self.geometry, "build") or hasattr(self.geometry, "points")):
            raise bad_value(
                f"Body {self.name}.geometry",
                self.geometry,
                "give a recipe, as Box(...), a Mesh, or the mass of a rigid body",
            )
        materials = self.material.values() if isinstance(self.material, Mapping) else (self.material,)
        if not all(type(material) in MATERIALS.values() for material in materials):  # others have no kernels
            known = " or ".join(f"{'an' if name[0] in 'AEIOU' else 'a'} {name}" for name in MATERIALS)
            remedy = f"give {known}, or one for each cell set; register other classes by warp_mca.register"
            raise bad_value(f"Body {self.name}.material", self.material, remedy)
        for material in materials:
            check_law(material)
            if material.finite_only and self.kinematics != "finite" and not self.rigid:
                remedy = f"set kinematics='finite', which {type(material).__name__} needs for its large strains"
                raise bad_value(f"Body {self.name}.kinematics", self.kinematics, remedy)
        if self.element not in tuple(ELEMENTS):
            raise bad_value(f"Body {self.name}.element", self.element, f"choose among {', '.join(ELEMENTS)}")
        validate.choice(f"Body {self.name}", ("corotational", "finite"), kinematics=self.kinematics)
        if self.across is not None:
            self._check_across(self.across)
        validate.flags(f"Body {self.name}", rigid=self.rigid, exact_mass=self.exact_mass)
        validate.vectors(
            f"Body {self.name}",
            position=self.position,
            rotation=self.rotation,
            velocity=self.velocity,
            angular_velocity=self.angular_velocity,
        )

    def _check_mass(self) -> None:
        """Check mass, centre and inertia, and let them stand for geometry and material where these are left out."""
        owner = f"Body {self.name}"
        if self.mass is None:
            for name, plain in (("inertia", None), ("centre", (0.0, 0.0, 0.0))):
                if getattr(self, name) != plain:
                    raise bad_value(f"{owner}.{name}", getattr(self, name), "it belongs to a mass; give that, too")
            return
        if self.rigid is not True:
            raise bad_value(f"{owner}.mass", self.mass, "a flexible body has that of its mesh; set rigid=True")
        validate.within(owner, LIGHTEST, HEAVIEST, mass=self.mass)
        validate.vectors(owner, centre=self.centre)
        inertia = inertia_matrix(owner, self.inertia)
        object.__setattr__(self, "inertia", inertia)
        from warp_mca.geometry.inertia_brick import InertiaBrick

        if self.geometry is None or isinstance(self.geometry, InertiaBrick):
            brick = InertiaBrick(mass=self.mass, centre=self.centre, inertia=inertia)
            object.__setattr__(self, "geometry", brick)
        if self.material is None:
            object.__setattr__(self, "material", STEEL)

    @property
    def is_inertia(self) -> bool:
        """Whether it is a mass with an inertia, without geometry."""
        return self.mass is not None and type(self.geometry).__name__ == "InertiaBrick"

    @property
    def fails(self) -> bool:
        """Whether one of its materials has a criterion of failure."""
        materials = self.material.values() if isinstance(self.material, Mapping) else (self.material,)
        return any(material.failure for material in materials)

    def _check_across(self, across: Vec3) -> None:
        turned = [name for name, element in ELEMENTS.items() if hasattr(element, "oriented")]
        if self.element not in turned:
            raise bad_value(
                f"Body {self.name}.across",
                across,
                f"{self.element} has no direction through a wall; leave it out or choose {' or '.join(turned)}",
            )
        validate.directions(f"Body {self.name}", across=across)

    def place_on(self, plane: RigidPlane, gap: float = 0.0) -> Body:
        """The body moved along the normal of a plane until its lowest node lies `gap` [m] above; it is meshed for it.

        Raises:
            RequestError: the gap is below 0, or the body cannot be meshed.
        """
        from warp_mca.geometry.mesh import Mesh

        _check_height("place_on: gap", gap, "give 0 or a distance above it, in metres")
        if not (hasattr(plane, "normal") and hasattr(plane, "point")):
            raise bad_value("place_on: plane", validate.brief(plane), "give a RigidPlane")
        mesh = self.geometry if isinstance(self.geometry, Mesh) else self.geometry.build()
        normal = np.array(plane.normal) / math.hypot(*plane.normal)
        placed = np.array(self.position) + mesh.points @ rotation_matrix(np.array(self.rotation)).T
        height = float(((placed - np.array(plane.point)) @ normal).min())
        x, y, z = (np.array(self.position) + (gap - height) * normal).tolist()
        return replace(self, position=(x, y, z))

    def drop(self, height: float, gravity: Vec3 = (0.0, -9.81, 0.0)) -> Body:
        """The body with the velocity sqrt(2 g h) along `gravity` [m/s^2] added, as after a fall from rest.

        Args:
            height: of the fall before the first step [m]; a gap that is left then is not counted.
            gravity: as in `Scene.gravity`.

        Raises:
            RequestError: the height is below 0, or there is no gravity.
        """
        _check_height("drop: height", height, "give 0 or a height above it, in metres")
        validate.vectors("drop", gravity=gravity)
        g = math.hypot(*gravity)
        if g == 0.0:
            raise bad_value("drop: gravity", gravity, "give a vector that is not zero, in m/s^2")
        x, y, z = (v + math.sqrt(2.0 * g * height) * w / g for v, w in zip(self.velocity, gravity, strict=True))
        return replace(self, velocity=(x, y, z))


def _check_height(field: str, value: float, remedy: str) -> None:
    if not (validate.is_number(value) and value >= 0.0):
        raise bad_value(field, value, remedy)
