"""Owns figures that are made, but neither laid out nor drawn, which takes longer than the runs of most tests."""

from __future__ import annotations

from functools import wraps
from pathlib import Path

import pytest

PNG = b"\x89PNG\r\n\x1a\n"  # how such a file begins


def draw_nothing(patch: pytest.MonkeyPatch) -> None:
    """Let the figures of results be files that only begin as such."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    draw = FigureCanvasAgg.print_png

    @wraps(draw)  # Matplotlib asks for its arguments
    def write(canvas: FigureCanvasAgg, to: object, **options: object) -> None:
        if isinstance(to, str | Path):
            Path(to).write_bytes(PNG)
        else:
            draw(canvas, to, **options)

    patch.setattr(ConstrainedLayoutEngine, "execute", lambda self, figure: None)
    patch.setattr(FigureCanvasAgg, "print_png", write)
    patch.setattr("warp_mca.pictures.mesh_picture.mesh_png", lambda *skins, **options: PNG)
