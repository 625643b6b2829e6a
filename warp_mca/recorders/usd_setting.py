"""Owns what a USD file holds beside bodies: materials that read displayColor, rigid planes, a camera and lights."""
# pyright: reportAttributeAccessIssue=false
# (usd-core comes without types)

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.pictures.setting import EYE, plane_meshes, up_of, view_axes

if TYPE_CHECKING:
    from warp_mca.pictures.setting import PlaneMesh
    from warp_mca.recorders.recorder import RunInfo

WIDTH, HEIGHT, FOCAL = 36.0, 20.25, 50.0  # of the camera's film and lens [mm]; it shows 16:9
ROOM = 1.15  # distance of the camera over the least that holds the bodies
LIGHT, DARK = (0.62, 0.63, 0.66), (0.45, 0.46, 0.5)  # squares of a plane, linear colours
STEEP = 0.7  # of the upward direction's z, above which z is the stage's up axis
SUN = np.array([0.4, 0.8, 0.45])  # direction to the light, in axes of the view
SUN_INTENSITY, SKY_INTENSITY = 0.85, 0.4


def set_up_axis(stage: Any, world: Any, up: NDArray) -> None:
    """Say which axis is up, z or y; where the scene's up is neither, turn `world` until it is."""
    from pxr import UsdGeom

    z_up = abs(up[2]) > STEEP
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z if z_up else UsdGeom.Tokens.y)
    axes = view_axes(up)
    target = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]) if z_up else np.eye(3)
    turn = axes.T @ target
    if not np.array_equal(turn, np.eye(3)):
        world.AddTransformOp().Set(_matrix(turn, np.zeros(3)))


def make_material(stage: Any, path: str) -> Any:
    """A UsdPreviewSurface whose diffuse colour is the primvar displayColor: most programs ignore that one alone."""
    from pxr import Sdf, UsdShade

    material = UsdShade.Material.Define(stage, path)
    reader = UsdShade.Shader.Define(stage, f"{path}/displayColor")
    reader.CreateIdAttr("UsdPrimvarReader_float3")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("displayColor")
    colour = reader.CreateOutput("result", Sdf.ValueTypeNames.Float3)
    surface = UsdShade.Shader.Define(stage, f"{path}/surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(colour)
    surface.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(0.6)
    surface.CreateInput("metallic", Sdf.ValueTypeNames.Float).Set(0.0)
    token = surface.CreateOutput("surface", Sdf.ValueTypeNames.Token)
    material.CreateSurfaceOutput().ConnectToSource(token)
    return material


def bind(material: Any, prim: Any) -> None:
    """Let `prim` be drawn with `material`."""
    from pxr import UsdShade

    UsdShade.MaterialBindingAPI.Apply(prim.GetPrim()).Bind(material)


class Setting:
    """Rigid planes, of which moving ones move with the frames, a camera and lights, below `root`."""

    def __init__(self, stage: Any, root: str, material: Any, info: RunInfo) -> None:
        points = np.concatenate([info.model.X[surface.nodes] for surface in info.surfaces.values()])
        self.moving: list[tuple[PlaneMesh, Any]] = []
        for k, plane in enumerate(plane_meshes(info.scene, points)):
            mesh = _plane(stage, f"{root}/plane_{k}", plane)
            bind(material, mesh)
            if plane.moves:
                self.moving.append((plane, mesh.AddTranslateOp()))
        seen = np.concatenate([info.model.X[info.surfaces[body].nodes] for body in info.striking])
        axes = view_axes(up_of(info.scene), np.ptp(seen, axis=0))
        _camera(stage, f"{root}/camera", seen, axes)
        _lights(stage, root, axes)

    def write(self, code: Any, time: float) -> None:
        """Move the planes that move to where they are at `time` [s]."""
        from pxr import Gf

        for plane, place in self.moving:
            place.Set(Gf.Vec3d(*plane.shift(time)), code)


def _plane(stage: Any, path: str, plane: PlaneMesh) -> Any:
    from pxr import UsdGeom, Vt

    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(plane.quads), 4, dtype=np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(plane.quads.ravel()))
    points = plane.points.astype(np.float32)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    mesh.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.array([points.min(axis=0), points.max(axis=0)])))
    mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(plane.normal[None].astype(np.float32)))
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.constant)
    colour = mesh.CreateDisplayColorPrimvar(UsdGeom.Tokens.uniform)
    colour.Set(Vt.Vec3fArray.FromNumpy(np.array([LIGHT, DARK], dtype=np.float32)))
    colour.CreateIndicesAttr().Set(Vt.IntArray.FromNumpy(plane.dark.astype(np.int32)))
    return mesh


def _camera(stage: Any, path: str, points: NDArray, axes: NDArray) -> None:
    """A camera that holds `points` [m], shape (point_count, 3), seen from `EYE` in `axes`."""
    from pxr import Gf, UsdGeom

    toward = EYE @ axes / np.linalg.norm(EYE)
    right = np.cross(axes[1], toward)
    right /= np.linalg.norm(right)
    look = np.array([right, np.cross(toward, right), toward])
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    x, y, z = look @ (points - centre).T
    distance = ROOM * float(max((z + 2.0 * FOCAL / WIDTH * abs(x)).max(), (z + 2.0 * FOCAL / HEIGHT * abs(y)).max()))
    camera = UsdGeom.Camera.Define(stage, path)
    camera.CreateHorizontalApertureAttr(WIDTH)
    camera.CreateVerticalApertureAttr(HEIGHT)
    camera.CreateFocalLengthAttr(FOCAL)
    camera.CreateClippingRangeAttr(Gf.Vec2f(0.01 * distance, 100.0 * distance))
    camera.CreateFocusDistanceAttr(distance)
    camera.AddTransformOp().Set(_matrix(look, centre + distance * toward))


def _lights(stage: Any, root: str, axes: NDArray) -> None:
    """A distant light from above and an even sky."""
    from pxr import Gf, UsdLux

    sun = UsdLux.DistantLight.Define(stage, f"{root}/sun")
    sun.CreateIntensityAttr(SUN_INTENSITY)
    sun.CreateAngleAttr(3.0)
    sun.CreateNormalizeAttr(True)
    toward = SUN @ axes / np.linalg.norm(SUN)
    right = np.cross(axes[1], toward)
    right /= np.linalg.norm(right)
    sun.AddTransformOp().Set(_matrix(np.array([right, np.cross(toward, right), toward]), np.zeros(3)))
    sky = UsdLux.DomeLight.Define(stage, f"{root}/sky")
    sky.CreateColorAttr(Gf.Vec3f(0.9, 0.95, 1.0))  # Blender leaves out a sky without it
    sky.CreateIntensityAttr(SKY_INTENSITY)


def _matrix(axes: NDArray, place: NDArray) -> Any:
    """The transform that takes x, y and z to the rows of `axes` and the origin to `place`."""
    from pxr import Gf

    matrix = np.eye(4)
    matrix[:3, :3], matrix[3, :3] = axes, place  # USD multiplies row vectors from the left
    return Gf.Matrix4d(matrix.tolist())
