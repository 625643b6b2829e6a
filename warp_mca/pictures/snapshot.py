"""Owns snapshot.png: deformed skins coloured by a field, and rigid planes, drawn without a display."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from warp_mca.geometry.cell_types import triangulated
from warp_mca.geometry.creases import Creases
from warp_mca.pictures.raster import rasterise
from warp_mca.pictures.setting import PlaneMesh, eye_axes, rounded, view_axes
from warp_mca.results.figure_style import DOTS_PER_INCH, engineering, new_figure, save_png

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.floating]

LIGHT = np.array([0.35, 0.80, 0.49])  # direction towards the light: right, upwards and to the viewer
AMBIENT = 0.55  # brightness of a surface turned away from it
PIXELS = 800  # along the longer side of a picture, unless asked for
FINER = 2  # times finer it is computed, for smooth edges
PLANE_LIGHT, PLANE_DARK = (0.88, 0.88, 0.90), (0.78, 0.79, 0.82)  # squares of planes


class Field(NamedTuple):
    """What colours a picture.

    Attributes:
        words: its name.
        unit: of its values.
        power: of the colour scale; a root shows weak waves beside a contact.
        beyond: share of the area where values may lie beyond the scale.
    """

    words: str
    unit: str
    power: float = 1.0
    beyond: float = 0.0


FIELDS = {
    "von_mises": Field("von Mises stress", "Pa", 0.5, 0.005),
    "plastic_strain": Field("equivalent plastic strain", "", 0.5),
    "displacement": Field("displacement", "m"),
    "velocity": Field("speed", "m/s"),
}


@dataclass(frozen=True)
class Skin:
    """The surface of a body at one time.

    Attributes:
        points: [m], shape (point_count, 3), float32 or float64.
        quads: corners of each face, counter-clockwise from outside, shape (face_count, 4), int32.
        value: of the field at the points, in its unit, shape (point_count,), float32 or float64.
    """

    points: Array
    quads: NDArray[np.int32]
    value: Array


@dataclass(frozen=True, kw_only=True)
class Look:
    """How a picture is drawn.

    Attributes:
        field: that colours it, a key of `FIELDS`.
        limit: value at the upper end of the colours; None takes `field_limit`.
        bounds: smallest and largest coordinates to show [m], shape (2, 3), float64; everything if None.
        up: unit vector upwards [-].
        planes: rigid planes behind the bodies.
        magnify: how many times the shape is magnified, for the title.
        pixels: along the longer side of the picture.
        camera: direction to the eye, as in `View`.
    """

    field: str = "von_mises"
    limit: float | None = None
    bounds: Array | None = None
    up: tuple[float, float, float] = (0.0, 1.0, 0.0)
    planes: Sequence[PlaneMesh] = ()
    magnify: float = 1.0
    pixels: int = PIXELS
    camera: tuple[float, float, float] | None = None


class Picture:
    """A figure of skins that can be drawn again at other times."""

    def __init__(self, skins: Mapping[str, Skin], time: float, look: Look) -> None:
        """Draw shaded skins on a scale of colours, with a bar of length, and the time after first contact [s]."""
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import PowerNorm

        bounds = look.bounds
        if bounds is None:
            points = np.concatenate([skin.points for skin in skins.values()])
            bounds = np.array([points.min(axis=0), points.max(axis=0)])
        self.look, self.eye = look, eye_axes(np.array(look.up), np.ptp(bounds, axis=0), look.camera)
        window = (
            np.array([[x, y, z] for x in bounds[:, 0] for y in bounds[:, 1] for z in bounds[:, 2]]) @ self.eye[:2].T
        )
        self.low, self.high = window.min(axis=0), window.max(axis=0)
        limit = look.limit if look.limit is not None else field_limit(skins, look.field)
        field = FIELDS[look.field]
        self.scale, unit = engineering(limit, field.unit) if field.unit else (1.0, "")
        self.colours = ScalarMappable(PowerNorm(field.power, 0.0, self.scale * limit or 1.0), "viridis")
        self.palette = np.vstack([self.colours.get_cmap()(np.arange(256))[:, :3], PLANE_LIGHT, PLANE_DARK])
        wide, tall = 1e3 * (self.high - self.low)
        self.figure = new_figure(4.5 * float(np.clip(wide / tall, 0.6, 1.6)) + 1.6, 4.8)
        self.axes = self.figure.add_subplot()
        extent = (1e3 * self.low[0], 1e3 * self.high[0], 1e3 * self.low[1], 1e3 * self.high[1])
        self.image = self.axes.imshow(self._image(skins, time), extent=extent, interpolation="antialiased")
        self.axes.set_axis_off()
        _draw_scale(self.axes, wide)
        bar = self.figure.colorbar(self.colours, ax=self.axes, extend="max", shrink=0.8)
        bar.set_label(f"{field.words} [{unit or '-'}]")
        self._say(time)

    def draw(self, skins: Mapping[str, Skin], time: float) -> None:
        """Replace what is shown by skins at another time [s], on the same scales."""
        self.image.set_data(self._image(skins, time))
        self._say(time)

    def _say(self, time: float) -> None:
        shape = "" if self.look.magnify == 1.0 else f", deformation × {self.look.magnify:g}"
        self.axes.set_title(f"{1e6 * time:.1f} µs after first contact{shape}", loc="left", fontsize=10)

    def _image(self, skins: Mapping[str, Skin], time: float) -> NDArray[np.uint8]:
        """What the eye sees, shape (height, width, 3)."""
        size = self.high - self.low
        pixels = np.maximum(np.round(self.look.pixels * size / size.max()).astype(int), 1)
        width, height = FINER * pixels
        parts = [_of_skin(skin) for skin in skins.values()]
        parts += [_of_plane(plane, time) for plane in self.look.planes]
        corners, normals, value = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
        front = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) @ self.eye[2] > 0.0
        corners, normals, value = corners[front], normals[front], value[front]
        on_screen = corners @ self.eye.T
        on_screen[:, :, 0] = (on_screen[:, :, 0] - self.low[0]) * width / size[0]
        on_screen[:, :, 1] = (self.high[1] - on_screen[:, :, 1]) * height / size[1]
        seen = rasterise(on_screen, int(width), int(height))
        up = np.array(self.look.up)
        level = view_axes(up) if self.look.camera is None else [self.eye[0], up, np.cross(self.eye[0], up)]
        towards = LIGHT / np.linalg.norm(LIGHT) @ level
        bright = AMBIENT + (1.0 - AMBIENT) * np.clip(normals @ towards, 0.0, 1.0)
        value, bright = seen.interpolated(np.stack([value, bright], axis=2)).T
        share = np.asarray(self.colours.norm(self.scale * np.maximum(value, 0.0)))
        level = np.where(value < 0.0, 255.0 - value, 255.0 * np.clip(share, 0.0, 1.0) + 0.5).astype(np.int32)
        picture = np.ones((width * height, 3), dtype=np.float32)
        picture[seen.pixel] = self.palette[level] * bright[:, None]
        blocks = picture.reshape(pixels[1], FINER, pixels[0], FINER, 3).mean(axis=(1, 3))
        return np.round(255.0 * blocks).astype(np.uint8)


def plot_snapshot(skins: Mapping[str, Skin], time: float, look: Look | None = None) -> Figure:
    """The figure of skins, by body, at `time` after first contact [s]."""
    return Picture(skins, time, look or Look()).figure


def save_snapshot(
    path: str | os.PathLike[str], skins: Mapping[str, Skin], time: float, look: Look | None = None
) -> Path:
    """Write the figure to `path` as PNG, at 200 dots per inch for 800 pixels."""
    look = look or Look()
    return save_png(plot_snapshot(skins, time, look), path, DOTS_PER_INCH * look.pixels / PIXELS)


def field_limit(skins: Mapping[str, Skin], field: str) -> float:
    """What a field stays below on the skins, but for a share of their area, `Field.beyond`."""
    triangles = [(skin, triangulated(skin.quads)) for skin in skins.values()]
    corners = np.concatenate([np.asarray(skin.points, dtype=float)[at] for skin, at in triangles])
    value = np.concatenate([np.asarray(skin.value, dtype=float)[at].mean(axis=1) for skin, at in triangles])
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    order = np.argsort(value)
    below = np.cumsum(np.linalg.norm(normal, axis=1)[order])
    return float(value[order][np.searchsorted(below, (1.0 - FIELDS[field].beyond) * below[-1])])


def _of_skin(skin: Skin) -> tuple[Array, Array, Array]:
    """Triangles of a skin: corners [m], normals and values there, shapes (count, 3, 3), (count, 3, 3), (count, 3)."""
    points = np.asarray(skin.points, dtype=float)
    normals, corner = Creases(skin.quads, points).by_triangle(points)
    return points[corner], normals, np.asarray(skin.value, dtype=float)[corner]


def _of_plane(plane: PlaneMesh, time: float) -> tuple[Array, Array, Array]:
    """Triangles of a plane, as `_of_skin` has them; values of light squares are -1, those of dark ones -2."""
    corners = (plane.points + plane.shift(time))[np.concatenate([plane.quads[:, [0, 1, 2]], plane.quads[:, [0, 2, 3]]])]
    value = np.where(np.tile(plane.dark, 2), -2.0, -1.0)
    return corners, np.broadcast_to(plane.normal, corners.shape), np.repeat(value[:, None], 3, axis=1)


def _draw_scale(axes: Axes, width: float) -> None:
    """A bar of round length, about a fifth of `width` [mm], in the lower left corner."""
    from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar

    length = rounded(0.2 * width)
    bar = AnchoredSizeBar(axes.transData, length, f"{length:g} mm", "lower left", pad=0.4, frameon=True)
    axes.add_artist(bar)
