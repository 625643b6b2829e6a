"""Owns snapshot.png: the deformed skin coloured by von Mises stress, drawn without a display."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.report.style import engineering, new_figure, save_png

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.floating]

LIGHT = np.array([0.35, 0.80, 0.49])  # direction towards the light, world frame
AMBIENT = 0.75  # brightness of a face turned away from it
EYE = np.array([0.30, 0.35, 0.89])  # direction from the scene to the eye


@dataclass(frozen=True)
class Skin:
    """The surface of a body at one time.

    Attributes:
        points: [m], shape (point_count, 3), float32 or float64.
        quads: corners of each face, counter-clockwise from outside, shape (face_count, 4), int32.
        von_mises: stress at the points [Pa], shape (point_count,), float32 or float64.
    """

    points: Array
    quads: NDArray[np.integer]
    von_mises: Array


def plot_snapshot(
    skins: Mapping[str, Skin], time: float, *, limit: float | None = None, bounds: Array | None = None
) -> Figure:
    """The figure: shaded faces coloured by von Mises stress on a square-root scale, with a colour bar.

    Args:
        skins: by body.
        time: after first contact [s].
        limit: stress at the upper end of the colours [Pa]; if None, what 99.5 % of the area seen stays below.
        bounds: smallest and largest coordinates to show [m], shape (2, 3); everything if None.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import PowerNorm

    corners, stress = _faces(skins)
    if bounds is None:
        bounds = np.array([corners.min(axis=(0, 1)), corners.max(axis=(0, 1))])
    window = _project(np.array([[x, y, z] for x in bounds[:, 0] for y in bounds[:, 1] for z in bounds[:, 2]]))
    low, high = 1e3 * window.min(axis=0), 1e3 * window.max(axis=0)
    if limit is None:
        limit = _exceeded(stress, _areas(corners), 0.005)
    scale, unit = engineering(limit, "Pa")
    colours = ScalarMappable(PowerNorm(0.5, 0.0, scale * limit or 1.0), "viridis")
    rgba = np.asarray(colours.to_rgba(scale * stress))
    rgba[:, :3] *= _brightness(corners)[:, None]
    wide, tall = high[:2] - low[:2]
    figure = new_figure(4.5 * float(np.clip(wide / tall, 0.6, 1.6)) + 1.6, 4.8)
    axes = figure.add_subplot()
    _draw(axes, corners, rgba)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    _draw_scale(axes, wide)
    bar = figure.colorbar(colours, ax=axes, extend="max", shrink=0.8)
    bar.set_label(f"von Mises stress [{unit}]")
    axes.set_title(f"{1e6 * time:.1f} µs after first contact", loc="left", fontsize=10)
    return figure


def save_snapshot(path: str | os.PathLike[str], skins: Mapping[str, Skin], time: float, **options) -> Path:
    """Write the figure to `path` as PNG at 200 dots per inch; `options` as for `plot_snapshot`."""
    return save_png(plot_snapshot(skins, time, **options), path)


def _areas(corners: Array) -> Array:
    """Of faces [m^2], shape (face_count,); corners as from `_faces`."""
    return 0.5 * np.linalg.norm(np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]), axis=1)


def _exceeded(value: Array, area: Array, share: float) -> float:
    """The value that is exceeded on `share` of the area: faces are many and small at a contact."""
    order = np.argsort(value)
    below = np.cumsum(area[order])
    return float(value[order][np.searchsorted(below, (1.0 - share) * below[-1])]) if len(value) else 0.0


def _axes_of_view() -> Array:
    """Directions to the right, upwards and to the eye, as rows, shape (3, 3); y is a scene's vertical."""
    eye = EYE / np.linalg.norm(EYE)
    right = np.cross([0.0, 1.0, 0.0], eye)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(eye, right), eye])


def _project(points: Array) -> Array:
    """Coordinates to the right, upwards and to the eye [m], the shape of `points`."""
    return points @ _axes_of_view().T


def _faces(skins: Mapping[str, Skin]) -> tuple[Array, Array]:
    """Faces towards the eye: corners [m], shape (face_count, 4, 3), and mean stress [Pa], shape (face_count,)."""
    corners = np.concatenate([np.asarray(s.points, dtype=float)[s.quads] for s in skins.values()])
    stress = np.concatenate([np.asarray(s.von_mises, dtype=float)[s.quads].mean(axis=1) for s in skins.values()])
    keep = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]) @ EYE > 0.0
    return corners[keep], stress[keep]


def _brightness(corners: Array) -> Array:
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(float).tiny)
    return AMBIENT + (1.0 - AMBIENT) * np.clip(normal @ LIGHT / np.linalg.norm(LIGHT), 0.0, 1.0)


def _draw(axes: Axes, corners: Array, rgba: Array) -> None:
    """Faces as seen from the eye, the farthest first."""
    from matplotlib.collections import PolyCollection

    seen = _project(corners)
    order = np.argsort(seen[:, :, 2].mean(axis=1))
    # Edges in the colour of their face close the seams between neighbours.
    faces = PolyCollection(1e3 * seen[order][:, :, :2], facecolors=rgba[order], edgecolors=rgba[order], linewidths=0.2)  # pyright: ignore[reportArgumentType]
    faces.set_rasterized(True)
    axes.add_collection(faces)
    axes.set_aspect("equal")
    axes.set_axis_off()


def _draw_scale(axes: Axes, width: float) -> None:
    """A bar of round length, about a fifth of `width` [mm], in the lower left corner."""
    from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar

    decade = 10.0 ** np.floor(np.log10(0.2 * width))
    length = decade * max(step for step in (1.0, 2.0, 5.0) if step * decade <= 0.2 * width)
    bar = AnchoredSizeBar(axes.transData, length, f"{length:g} mm", "lower left", pad=0.4, frameon=True)
    axes.add_artist(bar)
