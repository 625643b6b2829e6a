"""Owns the pictures of a run for its report: its mesh at the start, and what recorders have drawn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.results.figure_style import check_figures
from warp_mca.results.html_page import MEDIA, Image

if TYPE_CHECKING:
    from warp_mca.geometry.mesh import Mesh
    from warp_mca.recorders.recorder import Recorder
    from warp_mca.scene import Scene
    from warp_mca.system.model import Model

LARGEST = 32 << 20  # of a file that is put into the report [byte]


class Portrait:
    """The skins of a run as they were when its model was first assembled, and the recorders that draw more.

    Attributes:
        drawn: whether the run draws figures.
    """

    def __init__(self, recorders: Sequence[Recorder] = (), figures: str = "png") -> None:
        """Begin without a model.

        Raises:
            RequestError: `figures` is none of `FIGURES`.
        """
        self._recorders, self.drawn = recorders, check_figures(figures)
        self._taken: tuple[Scene, Model, Mapping[str, Mesh]] | None = None

    def take(self, scene: Scene, model: Model, meshes: Mapping[str, Mesh]) -> None:
        """Keep the first model."""
        self._taken = self._taken or (scene, model, meshes)

    def images(self, failed: Sequence[str] = ()) -> list[Image]:
        """The mesh, then pictures and films that recorders have written, but those that failed or are very large."""
        found = self._mesh()
        files = [Path(f) for r in self._recorders if r.name not in failed for f in getattr(r, "files", ())]
        for file in files:
            if file.suffix in MEDIA and file.is_file() and file.stat().st_size <= LARGEST:
                found.append(Image(file.name, file.suffix, file.read_bytes()))
        return found

    def _mesh(self) -> list[Image]:
        """The picture of the mesh, if there is one."""
        from warp_mca.pictures.mesh_picture import mesh_png
        from warp_mca.pictures.setting import plane_meshes, up_of
        from warp_mca.recorders.frames import skins

        if self._taken is None:
            return []
        scene, model, meshes = self._taken
        whole = np.zeros(len(model.element_of), dtype=bool)
        shown = {}
        for body, skin in skins(model, meshes).items():
            quads = skin.quads if skin.between is None else skin.quads[skin.seen(whole)]
            if len(quads):
                shown[body] = model.X[skin.nodes], quads
        if not shown:
            return []
        planes = plane_meshes(scene, np.concatenate([points for points, _ in shown.values()]))
        return [Image("Mesh at the start of the impact", ".png", mesh_png(shown, up=up_of(scene), planes=planes))]
