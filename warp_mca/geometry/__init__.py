"""Owns the import paths of the geometry recipes and of the mesh that they make."""

from warp_mca.geometry.box import Box
from warp_mca.geometry.cad import Cad
from warp_mca.geometry.cad_finer import Finer
from warp_mca.geometry.inertia_brick import InertiaBrick
from warp_mca.geometry.lug_rod import LugRod
from warp_mca.geometry.mesh import Mesh
from warp_mca.geometry.mesh_file import MeshFile
from warp_mca.geometry.nested_plate import NestedPlate
from warp_mca.geometry.parts import Part, Parts
from warp_mca.geometry.plate import Plate
from warp_mca.geometry.recipe import Recipe
from warp_mca.geometry.rod import Rod
from warp_mca.geometry.selection import Select
from warp_mca.geometry.sphere import Sphere

__all__ = [
    "Box",
    "Cad",
    "Finer",
    "InertiaBrick",
    "LugRod",
    "Mesh",
    "MeshFile",
    "NestedPlate",
    "Part",
    "Parts",
    "Plate",
    "Recipe",
    "Rod",
    "Select",
    "Sphere",
]
