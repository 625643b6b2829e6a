"""Owns the animation recorder: the deformed bodies over time as a film, drawn without a display."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import bad_value
from warp_mca.pictures.setting import VIEW, View
from warp_mca.recorders.pictures import FILM_PIXELS, Subject, for_film
from warp_mca.recorders.recorder import Cadence, FramesOnly, check_file

if TYPE_CHECKING:
    from warp_mca.pictures.snapshot import Look, Skin
    from warp_mca.recorders.recorder import Frame, RunInfo

FRAMES = Cadence(frames=100)
PLAYBACK = 20  # pictures shown in a second
DOTS_PER_INCH = 100  # of pictures of FILM_PIXELS
LAST = 1000  # how long a .gif shows the last picture before it begins again [ms]


class AnimationFile(FramesOnly):
    """Keeps the skins of each frame, and draws them all on one scale of colours when the run has ended."""

    def __init__(
        self,
        file: str | os.PathLike[str],
        *,
        cadence: Cadence = FRAMES,
        field: str = "von_mises",
        magnify: float = 1.0,
        limit: float | None = None,
        view: View = VIEW,
    ) -> None:
        """Draw to `file` (.gif or .mp4); `field` and the others as in `Subject`.

        Raises:
            RequestError: the file cannot be written, a value is not one, or nothing here can make .mp4 files.
        """
        self.path = check_file("animate", file, ".gif", ".mp4")
        self.name, self.files = str(self.path), (self.path,)
        self.subject = Subject(field, magnify, limit, view)
        self.needs, self.cadence = self.subject.needs, cadence
        self.encoder = _encoder(self.name) if self.path.suffix == ".mp4" else ""
        self._frames: list[tuple[float, dict[str, Skin]]] = []

    def check(self, info: RunInfo) -> None:
        """Refuse a view that does not suit the bodies."""
        self.subject.check(info)

    def start(self, info: RunInfo) -> None:
        """Keep the faces."""
        self.info, self._frames = info, []

    def frame(self, frame: Frame) -> None:
        """Keep it."""
        self._frames.append((frame.time, self.subject.skins(self.info, frame)))

    def finish(self, ok: bool) -> None:
        """Draw the frames that there are.

        Raises:
            OSError: the film cannot be written.
        """
        frames, self._frames = self._frames, []
        if not frames:
            return
        self.path.parent.mkdir(parents=True, exist_ok=True)
        part = self.path.with_name(f".{self.path.stem}.part{self.path.suffix}")
        try:
            pictures = _pictures(frames, self._look(frames))
            if self.encoder:
                _write_mp4(self.encoder, part, pictures)
            else:
                _write_gif(part, pictures)
            part.replace(self.path)
        finally:
            with suppress(OSError):
                part.unlink(missing_ok=True)

    def _look(self, frames: list[tuple[float, dict[str, Skin]]]) -> Look:
        """One for all: its box holds what strikes in every frame, its colours reach the greatest limit of any."""
        from warp_mca.pictures.snapshot import field_limit

        looks = [self.subject.look(self.info, skins) for _, skins in frames]
        boxes = np.stack([look.bounds for look in looks if look.bounds is not None])
        bounds = np.array([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])
        greatest = max(field_limit(skins, self.subject.field) for _, skins in frames)
        return for_film(looks[0], bounds, greatest, self.subject.view)


def _pictures(frames: list[tuple[float, dict[str, Skin]]], look: Look) -> Iterator[NDArray[np.uint8]]:
    """Red, green and blue of each picture, of even width and height, shape (height, width, 3), uint8."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    from warp_mca.pictures.snapshot import Picture

    picture = Picture(frames[0][1], frames[0][0], look)
    canvas = picture.figure.canvas
    assert isinstance(canvas, FigureCanvasAgg)
    picture.figure.set_dpi(DOTS_PER_INCH * look.pixels / FILM_PIXELS)
    for k, (time, skins) in enumerate(frames):
        if k:
            picture.draw(skins, time)
        canvas.draw()
        if not k:
            picture.figure.set_layout_engine("none")  # the layout stays as it is
        rgb = np.asarray(canvas.buffer_rgba())[:, :, :3]
        yield np.ascontiguousarray(rgb[: rgb.shape[0] // 2 * 2, : rgb.shape[1] // 2 * 2])


def _write_gif(path: Path, pictures: Iterator[NDArray[np.uint8]]) -> None:
    """One palette for all, so that colours mean the same in every picture."""
    from PIL import Image

    images = [Image.fromarray(picture) for picture in pictures]
    wide, tall = images[0].size
    every = Image.new("RGB", (wide, 3 * tall))
    for k, index in enumerate((0, len(images) // 2, -1)):
        every.paste(images[index], (0, k * tall))
    palette = every.quantize(256)
    first, *others = (image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images)
    durations = [1000 // PLAYBACK] * len(others) + [LAST]
    first.save(path, save_all=True, append_images=others, duration=durations, loop=0, optimize=True)


def _write_mp4(encoder: str, path: Path, pictures: Iterator[NDArray[np.uint8]]) -> None:
    """Hand the pictures to ffmpeg.

    Raises:
        OSError: it fails.
    """
    first = next(pictures)
    size = f"{first.shape[1]}x{first.shape[0]}"
    command = [encoder, "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size]
    command += [
        "-r",
        str(PLAYBACK),
        "-i",
        "-",
        "-pix_fmt",
        "yuv420p",
        "-crf",
        "20",
        "-movflags",
        "+faststart",
        str(path),
    ]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    assert process.stdin is not None and process.stderr is not None
    with suppress(BrokenPipeError):  # what went wrong is on its standard error
        process.stdin.write(first.tobytes())
        for picture in pictures:
            process.stdin.write(picture.tobytes())
    with suppress(BrokenPipeError):
        process.stdin.close()
    said = process.stderr.read().decode(errors="replace")
    if process.wait():
        raise OSError(f"ffmpeg failed ({' '.join(said.split())[:200]})")


def _encoder(file: str) -> str:
    """The program that makes .mp4 files.

    Raises:
        RequestError: there is none.
    """
    if found := shutil.which("ffmpeg"):
        return found
    try:
        from imageio_ffmpeg import get_ffmpeg_exe  # pyright: ignore[reportMissingImports]

        return get_ffmpeg_exe()
    except (ImportError, RuntimeError) as error:
        remedy = "ffmpeg makes .mp4 files: install it, or pip install imageio-ffmpeg, or name a .gif file"
        raise bad_value("animate", file, remedy) from error
