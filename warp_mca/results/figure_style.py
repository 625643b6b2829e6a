"""Owns the look of every figure: colours that survive colour-blind eyes and grey print, and how a PNG is written."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warp_mca.base.errors import bad_value

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

# Okabe and Ito's colours, told apart by colour-blind readers; line styles tell them apart in grey print.
BLUE, VERMILION, BLACK = "#0072B2", "#D55E00", "#222222"
GREEN, SKY, ORANGE, PURPLE = "#009E73", "#56B4E9", "#E69F00", "#CC79A7"
STICK = "#F0E442"
DOTS_PER_INCH = 200
COMPRESSION = 1  # of PNG: a fifth less time for the figures of a run, whose files are a fifth larger
LABEL = 0.18  # from the left edge of a figure to the labels of y axes [inch]
FIGURES = ("png", "none")  # what a run draws


def check_figures(value: object) -> bool:
    """Whether figures are drawn.

    Raises:
        RequestError: it is none of `FIGURES`.
    """
    if value not in FIGURES:
        raise bad_value("figures", value, f"give one of {', '.join(FIGURES)}")
    return value != "none"


def new_figure(width: float, height: float, layout: str = "constrained") -> Figure:
    """An empty figure of `width` by `height` [inch] that draws without a display; layout "none" for `place`."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout=layout)  # pyright: ignore[reportArgumentType]
    FigureCanvasAgg(figure)
    return figure


def place(
    figure: Figure,
    panels: Sequence[Axes] | NDArray[Any],
    *,
    left: float = 0.9,
    right: float = 0.2,
    top: float = 0.3,
    bottom: float = 0.55,
    gap: float = 0.18,
) -> None:
    """Give panels above each other fixed places, and line up the labels of their y axes.

    That takes half the time of a constrained layout, which draws all to know how large it is.

    Args:
        figure: that has them.
        panels: in one column, from the top, shape (panel_count,).
        left, right, top, bottom: room around them [inch].
        gap: between two [inch].
    """
    width, height = figure.get_size_inches()
    each = (height - top - bottom - gap * (len(panels) - 1)) / len(panels)
    figure.subplots_adjust(left / width, bottom / height, 1.0 - right / width, 1.0 - top / height, hspace=gap / each)
    for axes in panels:
        axes.yaxis.set_label_coords(-(left - LABEL) / (width - left - right), 0.5)


def tidy(axes: Axes) -> None:
    """Light grid behind the lines, open frame."""
    axes.grid(color="0.88", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def legend_beside(axes: Axes) -> None:
    """The legend, if there is anything to name, on the right of the axes, where it hides no line."""
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)


def save_png(figure: Figure, path: str | os.PathLike[str], dots_per_inch: float = DOTS_PER_INCH) -> Path:
    """Write the figure to `path` as PNG; its places are final then."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    engine = figure.get_layout_engine()
    figure.set_dpi(dots_per_inch)
    if engine is not None:  # figure.savefig would draw everything once more to lay it out
        engine.execute(figure)
        figure.set_layout_engine("none")
    # Without the date and version that matplotlib adds, equal runs give equal files.
    FigureCanvasAgg(figure).print_png(path, metadata={"Software": None}, pil_kwargs={"compress_level": COMPRESSION})
    return Path(path)


def engineering(greatest: float, unit: str) -> tuple[float, str]:
    """Factor and unit that bring `greatest` [unit] to a number of few digits: (1e-3, "kN") for 2000 N.

    Metres, and what is measured in them, get no greater prefix than k: nobody reads Mm/s².
    """
    if unit.startswith("m") and abs(greatest) >= 1e3:
        return 1e-3, "k" + unit
    for limit, prefix in ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m")):
        if abs(greatest) >= limit:
            return 1.0 / limit, prefix + unit
    return (1e6, "µ" + unit) if greatest else (1.0, unit)
