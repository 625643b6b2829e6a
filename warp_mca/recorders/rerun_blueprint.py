"""Owns what the rerun viewer shows at first: waves, forces, energies and path stress side by side, and a legend."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from warp_mca.pictures.setting import view_axes
from warp_mca.recorders.colours import PALETTE, SLIP, STICK, ColourScale, stress_at

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

# Columns of the history by plot: name, title, (column, label, colour); colours are Okabe and Ito's.
PLOTS = (
    ("force", "contact force [N]", (("F_n_N", "F_n", 0x56B4E9FF), ("F_t_N", "F_t", 0xD55E00FF))),
    (
        "velocity",
        "velocity [m/s]",
        (
            ("tip_vx", "tip v_x", 0xD55E00FF),
            ("tip_vy", "tip v_y", 0x56B4E9FF),
            ("tip_vz", "tip v_z", 0xE69F00FF),
            ("plate_vx", "plate v_x", 0xBBBBBBFF),
            ("closing_speed", "closing speed", 0x009E73FF),
        ),
    ),
    (
        "energy",
        "energy [J]",
        (
            ("E_kinetic", "kinetic", 0xBBBBBBFF),
            ("E_internal", "internal", 0x56B4E9FF),
            ("E_plastic", "plastic", 0xD55E00FF),
            ("E_friction", "friction", 0x009E73FF),
            ("E_contact", "contact", 0xE69F00FF),
            ("E_total_error", "error", 0xCC79A7FF),
        ),
    ),
)
PATH_COLOURS = (0xD55E00FF, 0x009E73FF, 0x56B4E9FF, 0xE69F00FF, 0xCC79A7FF)
BAR = (256, 14)  # of the legend, in its own units
TICKS = 5
FRONT = np.array([0.12, 0.25, 0.96])  # direction to the eye: right, upwards and to the viewer
OUTSIDE = 0.85  # share of the direction to the eye of the contact view that points out of the slave
BACKGROUND = (222, 223, 228)  # light, so that the dark end of the palette stands out


def log_styles(stream: rr.RecordingStream) -> None:
    """Name and colour the curves of the plots, once."""
    import rerun as rr

    for plot, _, curves in PLOTS:
        for column, label, colour in curves:
            stream.log(f"plots/{plot}/{column}", rr.SeriesLines(colors=colour, names=label, widths=1.5), static=True)


def log_legend(stream: rr.RecordingStream) -> None:
    """The colour bar and the two kinds of contact point, which never change."""
    import rerun as rr

    width, height = BAR
    bar = np.repeat(PALETTE[np.linspace(0, 255, width).astype(int)][None], height, axis=0)
    stream.log("legend/bar", rr.Image(bar), static=True)
    points = rr.Points2D(
        [(0.0, 42.0), (128.0, 42.0)],
        colors=[STICK, SLIP],
        radii=2.5,
        labels=["contact point that sticks", "that slips"],
        show_labels=True,
    )
    stream.log("legend/contact", points, static=True)


def log_ticks(stream: rr.RecordingStream, scale: ColourScale) -> None:
    """The stresses at the marks of the colour bar [MPa], from now on."""
    import rerun as rr

    at = np.linspace(0.0, 1.0, TICKS)
    labels = [f"{1e-6 * stress_at(share, scale.limit):.3g}" for share in at]
    labels[-1] = f"≥ {labels[-1]} MPa" if scale.fixed else f"{labels[-1]} MPa"
    places = np.column_stack([at * BAR[0], np.full(TICKS, BAR[1] + 2.0)])
    stream.log("legend/ticks", rr.Points2D(places, colors=0xFFFFFFFF, radii=1.0, labels=labels, show_labels=True))


class Sights(NamedTuple):
    """Where the views look at first.

    Attributes:
        up: unit vector upwards [-], shape (3,), float64.
        bounds: smallest and largest coordinates of what the first view should hold [m], shape (2, 3), float64.
        focus: where contact is expected [m], and the normal of the slave's skin there [-], shape (2, 3), float64; or
            None.
        reach: size of the surface that may touch there [m].
    """

    up: NDArray[np.floating]
    bounds: NDArray[np.float64]
    focus: NDArray[np.float64] | None
    reach: float = 0.0


def log_up(stream: rr.RecordingStream, up: NDArray[np.floating]) -> None:
    """Say which axis of the world is up, by the nearest one."""
    import rerun as rr

    axis = int(np.argmax(np.abs(up)))
    name = f"RIGHT_HAND_{'XYZ'[axis]}_{'UP' if up[axis] > 0.0 else 'DOWN'}"
    stream.log("world", getattr(rr.ViewCoordinates, name), static=True)


def blueprint(
    scale: ColourScale, sights: Sights, struck: Sequence[str], paths: Sequence[tuple[str, str]]
) -> rrb.Blueprint:
    """The layout.

    Args:
        scale: named in the legend's title.
        sights: where the views look.
        struck: entities that would hide the contact, left out of the view of it.
        paths: entity of the stress along each path, and what the path is.
    """
    import rerun.blueprint as rrb

    legend = rrb.Spatial2DView(
        origin="/legend",
        name=scale.label,
        visual_bounds=rrb.VisualBounds2D(x_range=[-24.0, 290.0], y_range=[-6.0, 56.0]),
        background=(24, 24, 28),
    )
    extent = sights.bounds[1] - sights.bounds[0]
    size = float(np.linalg.norm(extent))
    axes = view_axes(sights.up, extent)
    front = 1.15 * size * FRONT @ axes
    views: list[rrb.View] = [_view("waves", sights.bounds.mean(axis=0), front, sights.up, ["+ /world/**"])]
    if sights.focus is not None:
        place, outwards = sights.focus
        aside = axes[2] - (axes[2] @ outwards) * outwards
        if np.linalg.norm(aside) < 0.5:  # the contact faces the viewer
            aside = axes[1]
        distance = float(np.clip(1.2 * sights.reach, 0.1 * size, 0.3 * size))
        eye = distance * (OUTSIDE * outwards + np.sqrt(1.0 - OUTSIDE**2) * aside / np.linalg.norm(aside))
        contents = ["+ /world/**", *(f"- {path}/**" for path in struck)]
        views.append(_view("contact, without what is struck", place, eye, sights.up, contents))
    plots: list[rrb.View] = [
        rrb.TimeSeriesView(origin=f"/plots/{name}", name=title, plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop))
        for name, title, _ in PLOTS
    ]
    hidden = rrb.PlotLegend(visible=False)
    bars = [rrb.BarChartView(origin=path, name=f"{name} [MPa, mm]", plot_legend=hidden) for path, name in paths]
    rows = [legend, rrb.Horizontal(*views, column_shares=[2, 1][: len(views)]), *([rrb.Horizontal(*bars)] * bool(bars))]
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(*rows, row_shares=[1, 4, 2][: len(rows)]),
            rrb.Vertical(*plots),
            column_shares=[3, 2],
        ),
        rrb.TimePanel(timeline="sim_time", play_state="following", state="collapsed"),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        auto_views=False,
    )


def _view(name: str, target: NDArray, offset: NDArray, up: NDArray, contents: list[str]) -> rrb.Spatial3DView:
    """A view of `contents` from `target` + `offset` [m]."""
    import rerun.blueprint as rrb

    return rrb.Spatial3DView(
        origin="/world",
        name=name,
        contents=contents,
        background=BACKGROUND,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(position=target + offset, look_target=target, eye_up=up),
    )
