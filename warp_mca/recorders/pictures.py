"""Owns what pictures of a run show: a field on skins, with their shape as it is or magnified."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import bad_value
from warp_mca.base.validate import brief, is_number, kind_of
from warp_mca.pictures.magnify import magnified
from warp_mca.pictures.setting import VIEW, View, plane_meshes, up_of
from warp_mca.pictures.snapshot import FIELDS, PIXELS, Look, Skin
from warp_mca.recorders.recorder import SURFACE, VOLUME

if TYPE_CHECKING:
    from warp_mca.recorders.recorder import Frame, RunInfo

FILM_PIXELS = 600  # along the longer side of pictures of a film
MAX_MAGNIFY = 1e6  # shapes far larger exceed the numbers that pictures are drawn with
MARGIN = 0.05  # around the bodies that strike, as a share of their size


class Subject:
    """A field on the skins of a run.

    Attributes:
        needs: what frames must hold.
    """

    def __init__(
        self, field: str = "von_mises", magnify: float = 1.0, limit: float | None = None, view: View = VIEW
    ) -> None:
        """Show `field`, with `magnify` times the deformation.

        Args:
            field: von_mises, plastic_strain, displacement or velocity.
            magnify: of the motion of nodes less the rigid motion of their body that is nearest to it.
            limit: value at the upper end of the colours, in the field's unit; None takes it from what is shown.
            view: what is shown, and from where.

        Raises:
            RequestError: there is no such field, a number is not above 0, `magnify` is above 1e6, or `view` is no View.
        """
        if field not in FIELDS:
            raise bad_value("field", brief(field), f"choose one of {', '.join(FIELDS)}")
        if not (is_number(magnify) and 0.0 < magnify <= MAX_MAGNIFY):
            remedy = f"give a factor above 0, at most {MAX_MAGNIFY:g}; 1 shows the shape as it is"
            raise bad_value("magnify", brief(magnify), remedy)
        if limit is not None and not (is_number(limit) and limit > 0.0):
            raise bad_value("limit", brief(limit), f"give the {FIELDS[field].words} at the upper end of the colours")
        kind_of("view", view, View, "give a View, as View(pixels=1600)")
        self.field, self.magnify, self.limit, self.view = field, magnify, limit, view
        self.on_skins = magnify == 1.0 and field in ("von_mises", "plastic_strain")
        self.needs = frozenset((SURFACE if self.on_skins else VOLUME,))

    def check(self, info: RunInfo) -> None:
        """Refuse a view that the bodies of a run do not suit.

        Raises:
            RequestError: so it is.
        """
        self.view.check(info.surfaces)

    def skins(self, info: RunInfo, frame: Frame) -> dict[str, Skin]:
        """The skins in a frame, by body; their arrays are the caller's."""
        if self.on_skins:
            values = getattr(frame, self.field)
            found = {body: (frame.points[body].copy(), values[body].copy()) for body in info.surfaces}
        else:
            found = {body: self._from_volume(info, frame, surface.nodes) for body, surface in info.surfaces.items()}
        quads = {body: surface.quads for body, surface in info.surfaces.items()}
        faces = frame.faces
        if frame.volume is not None and (failed := frame.volume.failed) is not None:
            skins = {body: skin for body, skin in info.surfaces.items() if skin.between is not None}
            faces = {body: skin.seen(failed) for body, skin in skins.items()}
        quads |= {body: quads[body][seen] for body, seen in faces.items()}
        shown = ((body, *skin) for body, skin in found.items() if body not in self.view.hidden)
        return {body: Skin(points, quads[body], value) for body, points, value in shown}

    def look(self, info: RunInfo, skins: Mapping[str, Skin]) -> Look:
        """How they are drawn: bodies that strike, as much of the others as lies around these, and rigid planes."""
        striking = [body for body in info.striking if body in skins] or list(skins)
        points = np.concatenate([skins[body].points for body in striking])
        margin = MARGIN * float(np.ptp(points, axis=0).max())
        bounds = np.array([points.min(axis=0) - margin, points.max(axis=0) + margin])
        everything = np.concatenate([skin.points for skin in skins.values()])
        planes = plane_meshes(info.scene, everything)
        x, y, z = up_of(info.scene).tolist()
        return Look(
            field=self.field,
            limit=self.limit,
            bounds=bounds,
            up=(x, y, z),
            planes=planes,
            magnify=self.magnify,
            pixels=self.view.pixels or PIXELS,
            camera=self.view.camera,
        )

    def _from_volume(self, info: RunInfo, frame: Frame, nodes: NDArray[np.int32]) -> tuple[NDArray, NDArray]:
        """Points [m] and values at `nodes`."""
        assert frame.volume is not None
        value = np.array(getattr(frame.volume, self.field)[nodes])
        if value.ndim == 2:
            value = np.linalg.norm(value, axis=1)
        X, u = info.model.X[nodes], frame.volume.displacement[nodes].astype(np.float64)
        return magnified(X, u, self.magnify), value


def for_film(look: Look, bounds: NDArray[np.float64], limit: float, view: View = VIEW) -> Look:
    """The same for a box [m], in fewer pixels and with this value at the upper end of the colours unless asked for."""
    pixels = view.pixels or FILM_PIXELS
    return replace(look, bounds=bounds, limit=look.limit if look.limit is not None else limit, pixels=pixels)
