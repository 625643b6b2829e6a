"""Tests what pictures of a run show: fields, magnified shapes, planes, and films of them."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from flying_bars import FlyingBars
from PIL import Image
from test_full_disk import files_up_to

import warp_mca as mca
from warp_mca.base.errors import RequestError
from warp_mca.base.rotation import rotation_matrix
from warp_mca.cli.parser import make_parser
from warp_mca.cli.recorders import recorders_of
from warp_mca.pictures.magnify import magnified
from warp_mca.pictures.snapshot import FIELDS, Look, Picture, Skin, field_limit
from warp_mca.recorders import AnimationFile, SnapshotFile, View
from warp_mca.recorders.pictures import Subject
from warp_mca.recorders.recorder import SURFACE, VOLUME

RNG = np.random.default_rng(3)


def test_only_what_a_picture_shows_is_asked_for():
    assert Subject().needs == Subject("plastic_strain").needs == {SURFACE}
    assert Subject("velocity").needs == Subject(magnify=2.0).needs == {VOLUME}


def test_fields_are_those_of_the_frame(bars: FlyingBars):
    frame, volume = bars.frame(2), bars.frame(2).volume
    assert volume is not None
    for field in FIELDS:
        skins = Subject(field).skins(bars.info, frame)
        for body, surface in bars.info.surfaces.items():
            shown = getattr(volume, field)[surface.nodes]
            if field == "von_mises":
                shown = frame.von_mises[body]  # in this test the nodes have other stresses than the skins
            np.testing.assert_allclose(skins[body].value, np.linalg.norm(shown.reshape(len(shown), -1), axis=1))
            np.testing.assert_allclose(skins[body].points, frame.points[body], atol=1e-8)


def test_magnified_shapes_keep_the_rigid_motion():
    X = RNG.random((40, 3))
    turned = (X - 0.3) @ rotation_matrix(np.array([0.4, -1.1, 0.7])).T + [1.0, 2.0, 3.0]
    np.testing.assert_allclose(magnified(X, turned - X, 1000.0), turned, atol=1e-10)
    stretch = 1e-3 * (X - X.mean(axis=0)) * [1.0, -0.3, -0.3]
    np.testing.assert_allclose(magnified(X, stretch, 50.0), X + 50.0 * stretch, atol=0.01)  # the nearest turn is small
    mirrored = X * [1.0, 1.0, -1.0]
    moved = magnified(X, mirrored - X, 1e-9)  # the nearest turn, not the mirror
    np.testing.assert_allclose(
        np.linalg.norm(moved[1:] - moved[:-1], axis=1), np.linalg.norm(np.diff(X, axis=0), axis=1), rtol=1e-6
    )


def test_a_picture_has_the_colour_of_the_field_and_the_floor_below(bars: FlyingBars):
    floor = mca.RigidPlane(point=(0.0, -0.002, 0.0))
    contact = mca.Contact(slave=mca.Surface(body="lower", nodes="ymin"), master=floor)
    scene = dataclasses.replace(bars.info.scene, contacts=(contact,))
    info = dataclasses.replace(bars.info, scene=scene)
    subject = Subject(limit=2e6)
    skins = subject.skins(info, bars.frame(8))  # 8 MPa: the yellow end of the palette
    image = np.asarray(Picture(skins, 0.0, subject.look(info, skins)).image.get_array()).astype(int)
    red, green, blue = np.moveaxis(image, -1, 0)
    bodies, ground = (red > 2 * blue) & (green > 2 * blue), (abs(red - blue) < 12) & (red < 245)
    assert bodies.mean() > 0.05
    assert ground.mean() > 0.05
    rows = np.arange(len(image))[:, None] * np.ones_like(red)
    assert rows[ground].mean() > rows[bodies].mean()


def test_up_turns_the_picture():
    """A bar along z, hot at its upper end."""
    box = mca.Box(size=(0.1, 0.1, 1.0), divisions=(1, 1, 8)).build()
    skin = {"bar": Skin(box.points, box.boundary[0], box.points[:, 2])}
    image = np.asarray(Picture(skin, 0.0, Look(field="displacement", limit=1.0, up=(0.0, 0.0, 1.0))).image.get_array())
    middle = image[:, image.shape[1] // 2].astype(float)
    assert image.shape[0] > 3 * image.shape[1]
    assert middle[len(middle) // 10].sum() > 1.5 * middle[-len(middle) // 10].sum()


def test_a_few_faces_do_not_set_the_scale_of_stress():
    box = mca.Box(size=(1.0, 1.0, 1.0), divisions=(20, 20, 20)).build()
    stress = np.ones(len(box.points))
    stress[0] = 100.0
    skin = {"box": Skin(box.points, box.boundary[0], stress)}
    assert field_limit(skin, "von_mises") == 1.0
    assert field_limit(skin, "plastic_strain") > 10.0


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"field": "heat"}, "field = 'heat': choose one of von_mises, plastic_strain, displacement, velocity"),
        ({"magnify": 0.0}, "magnify = 0.0: give a factor above 0"),
        ({"magnify": 1e300}, r"magnify = 1e\+300: give a factor above 0, at most 1e\+06"),
        ({"limit": -1.0}, "limit = -1.0: give the von Mises stress at the upper end of the colours"),
    ],
)
def test_what_cannot_be_drawn_is_refused(tmp_path: Path, options: dict, why: str):
    for make in (
        lambda: SnapshotFile(tmp_path / "a.png", time=0.0, **options),
        lambda: AnimationFile(tmp_path / "a.gif", **options),
    ):
        with pytest.raises(RequestError, match=why):
            make()


def film(file: Path, bars: FlyingBars, frames: int) -> None:
    recorder = AnimationFile(file)
    recorder.start(bars.info)
    for index in range(frames):
        recorder.frame(bars.frame(index))
    recorder.finish(True)


def test_a_film_has_a_picture_for_each_frame_on_one_scale(bars: FlyingBars, tmp_path: Path):
    from PIL import Image

    film(tmp_path / "a.gif", bars, 3)
    with Image.open(tmp_path / "a.gif") as images:
        assert images.n_frames == 3
        shown = []
        for k in range(3):
            images.seek(k)
            shown.append(np.asarray(images.convert("RGB")).astype(int))
    yellow = [((image[..., 0] > 2 * image[..., 2]) & (image[..., 1] > 150)).mean() for image in shown]
    assert yellow[2] > yellow[1] + 0.02  # bodies take the end of the colours in the last frame only
    assert [path.name for path in tmp_path.iterdir()] == ["a.gif"]


def test_a_film_without_frames_is_not_written(bars: FlyingBars, tmp_path: Path):
    film(tmp_path / "a.gif", bars, 0)
    assert not list(tmp_path.iterdir())


def test_a_full_disk_leaves_no_film(bars: FlyingBars, tmp_path: Path):
    recorder = AnimationFile(tmp_path / "a.gif")
    recorder.start(bars.info)
    recorder.frame(bars.frame(1))
    with files_up_to(1000), pytest.raises(OSError):
        recorder.finish(True)
    assert not list(tmp_path.iterdir())


def test_mp4_needs_ffmpeg(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setitem(__import__("sys").modules, "imageio_ffmpeg", None)
    with pytest.raises(RequestError, match=r"ffmpeg makes .mp4 files: install it, or .* name a .gif file"):
        AnimationFile(tmp_path / "a.mp4")


def test_mp4_films_are_made_where_ffmpeg_is(bars: FlyingBars, tmp_path: Path):
    pytest.importorskip("imageio_ffmpeg")
    film(tmp_path / "a.mp4", bars, 2)
    assert (tmp_path / "a.mp4").read_bytes()[4:8] == b"ftyp"


def test_what_ffmpeg_says_is_told(bars: FlyingBars, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    encoder = tmp_path / "ffmpeg"
    encoder.write_text("#!/bin/sh\necho no such codec >&2\nexit 3\n")
    encoder.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/bin:/usr/bin")
    with pytest.raises(OSError, match=r"ffmpeg failed \(no such codec\)"):
        film(tmp_path / "a.mp4", bars, 1)


def test_the_command_line_draws_what_is_asked_for(tmp_path: Path):
    words = ["run", "two_link", "--snapshot", "5e-6", "--animate", str(tmp_path / "a.gif"), "--frames", "7"]
    args = make_parser().parse_args(
        [*words, "--field", "velocity", "--magnify", "30", "--hide", "plate", "--camera=-1,0,0"]
    )
    animation, snapshot = recorders_of(args, tmp_path)
    assert isinstance(animation, AnimationFile) and isinstance(snapshot, SnapshotFile)
    assert animation.cadence.frames == 7
    assert snapshot.path.name == "snapshot-5us-velocity.png"
    for recorder in (animation, snapshot):
        assert (recorder.subject.field, recorder.subject.magnify) == ("velocity", 30.0)
        assert recorder.subject.view == View(camera=(-1.0, 0.0, 0.0), hidden=("plate",))


def test_a_view_says_size_camera_and_hidden_bodies(bars: FlyingBars, tmp_path: Path):
    """From above, a bar that is alone covers its length by its width; twice the pixels make twice the picture."""
    subject = Subject(view=View(camera=(0.0, 1.0, 0.0), hidden=("upper bar",), pixels=300))
    subject.check(bars.info)
    skins = subject.skins(bars.info, bars.frame(1))
    assert list(skins) == ["lower"]
    picture = Picture(skins, 0.0, subject.look(bars.info, skins))
    np.testing.assert_allclose(np.abs(picture.eye[2]), [0.0, 1.0, 0.0], atol=1e-12)
    margin = 0.1 * np.ptp(skins["lower"].points, axis=0).max()
    seen = sorted(np.ptp(skins["lower"].points, axis=0)[[0, 2]] + margin)
    np.testing.assert_allclose(sorted(picture.high - picture.low), seen, rtol=1e-6)
    assert max(picture.image.get_array().shape[:2]) == 300
    sizes = []
    for pixels in (200, 400):
        recorder = SnapshotFile(tmp_path / f"{pixels}.png", time=0.0, view=View(pixels=pixels))
        recorder.start(bars.info)
        recorder.frame(bars.frame(0))
        sizes.append(Image.open(recorder.path).size)
    np.testing.assert_allclose(sizes[1], 2 * np.array(sizes[0]), atol=2)


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"pixels": 10}, "View.pixels = 10: give a whole number from 50 to 8000"),
        ({"camera": (0.0, 0.0, 0.0)}, r"View.camera = \(0.0, 0.0, 0.0\): give a direction other than zero"),
        ({"hidden": ("ball",)}, "View.hidden = 'ball': choose among"),
        ({"hidden": ("upper bar", "lower")}, "nothing would be left to show"),
    ],
)
def test_views_that_show_nothing_are_refused(bars: FlyingBars, given: dict, why: str):
    with pytest.raises(RequestError, match=why):
        View(**given).check(bars.info.surfaces)
