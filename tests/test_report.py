"""report.html of a run: its figures are those of summary.json, its pictures are in it, nothing comes from outside."""

from __future__ import annotations

import base64
import io
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from warp_mca.cli.main import main
from warp_mca.pictures.mesh_picture import mesh_png
from warp_mca.pictures.setting import eye_axes
from warp_mca.results.report import report_html
from warp_mca.results.storage import load

SCENE = '''
import warp_mca as mca


def build(v: float = 2.0) -> mca.Scene:
    """A cube of steel strikes a wall; its name would be markup."""
    steel = mca.J2Bilinear(E=200e9, nu=0.3, rho=7800.0, sigma_y=40e6, E_t=2e9)
    geometry = mca.Box(size=(0.01, 0.01, 0.01), divisions=(2, 2, 2))
    cube = mca.Body(name="<i>cube", geometry=geometry, material=steel, velocity=(-v, 0.0, 0.0))
    wall = mca.RigidPlane(point=(0.0, 0.0, 0.0), normal=(1.0, 0.0, 0.0))
    return mca.Scene(
        name="cube",
        bodies=(cube,),
        contacts=(mca.Contact(name="wall", slave=mca.Surface(body="<i>cube", nodes="xmin"), master=wall),),
        probes=(mca.Probe(name="top", body="<i>cube", nodes="xmax", cfc=1000),),
        sections=(mca.Section(name="middle", body="<i>cube", at=(0.004, 0.0, 0.0), normal=(1.0, 0.0, 0.0)),),
        criteria=("max_von_mises < 1e6", "F_n_max < 1e9"),
        impact=mca.ImpactPhase(duration=1e-5, output_interval=1e-6),
    )
'''
PREFIXES = {"G": 1e9, "M": 1e6, "k": 1e3, "": 1.0, "m": 1e-3, "µ": 1e-6}
SCALES = {prefix + unit: scale for prefix, scale in PREFIXES.items() for unit in ("N", "N m", "N s", "J", "s")}
SCALES |= {"MPa": 1e6, "mm": 1e-3, "%": 1e-2, **dict.fromkeys(("", "kg", "m/s", "m/s²"), 1.0)}


class Page(HTMLParser):
    """What a report says.

    Attributes:
        figures: text, key in the summary and exact value of each figure.
        text: of the whole page.
        sources: of pictures and films, by their captions.
        outside: what other addresses it names.
    """

    def __init__(self, text: str) -> None:
        super().__init__()
        self.figures: list[tuple[str, list[str | int], Any]] = []
        self.text, self.sources, self.outside = "", {}, []
        self._open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self._open.append(tag)
        if tag == "data":
            self.figures.append(("", json.loads(given["data-key"]), json.loads(given["value"])))
        for name in ("src", "href"):
            if name in given and given[name].startswith("data:"):
                self.sources[given.get("alt", tag)] = given[name]
            elif name in given:
                self.outside.append(given[name])
        if tag in ("img", "meta"):
            self._open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data
        if self._open and self._open[-1] == "data":
            _, key, value = self.figures.pop()
            self.figures.append((data, key, value))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("report")
    (out / "cube.py").write_text(SCENE)
    command = ["run", str(out / "cube.py"), "--out", str(out), "--animate", str(out / "film.gif"), "--frames", "2"]
    assert main(command) == 3
    return out


@pytest.fixture(scope="module")
def page(folder: Path) -> Page:
    return Page((folder / "report.html").read_text(encoding="utf-8"))


def at(summary: Any, key: list[str | int]) -> Any:
    for part in key:
        summary = summary[part]
    return summary


def test_figures_are_those_of_the_summary(folder: Path, page: Page):
    """The exact value in the markup, and what one reads to four digits."""
    summary = json.loads((folder / "summary.json").read_text())
    for text, key, value in page.figures:
        assert at(summary, key) == value, key
        if isinstance(value, float):
            number, unit = re.fullmatch(r"([-+.e\d]+) ?(.*)", text).groups()
            assert float(number) * SCALES[unit] == pytest.approx(value, rel=1e-3), (key, text)
    shown = {json.dumps(key) for _, key, _ in page.figures}
    body = ["bodies", "<i>cube"]
    wanted = [
        *(["criteria", k, name] for k in range(2) for name in ("criterion", "value", "limit", "margin")),
        *([*body, peak, "value"] for peak in ("max_von_mises", "max_plastic_strain")),
        *([*body, "max_von_mises", name] for name in ("at", "time")),
        ["contacts_by_pair", 0, "F_max"],
        ["probes", 0, "acceleration_cfc_max"],
        ["sections", 0, "F_max"],
        ["energy", "plastic"],
        ["energy_error"],
        ["contact_spring_loss", "wall"],
        ["n_elements"],
        ["parameters", "v"],
    ]
    assert {json.dumps(key) for key in wanted} <= shown


def test_text_has_verdicts_names_and_warnings(folder: Path, page: Page):
    """Names and sentences are text, whatever is in them."""
    result = replace(load(folder), warnings=("cells of <i>cube & others",))
    result.summary["contact_open_at_end"] = True
    told = Page(report_html(result, folder)).text
    assert "cells of <i>cube & others" in told and "A contact was closed at the end" in told
    assert "1 of 2 criteria are met." in page.text and "<i>cube" in page.text


def test_pictures_and_film_are_in_it(folder: Path, page: Page):
    assert page.outside == []
    shown = {name: base64.b64decode(source.partition(",")[2]) for name, source in page.sources.items()}
    assert shown["film.gif"] == (folder / "film.gif").read_bytes()
    assert shown["Contact forces, and velocities below"] == (folder / "forces.png").read_bytes()
    mesh = np.asarray(Image.open(io.BytesIO(shown["Mesh at the start of the impact"])).convert("RGB")).astype(int)
    assert (mesh[..., 2] - mesh[..., 0] > 40).mean() > 0.1  # the blue of the first body


def test_a_mesh_covers_as_many_pixels_as_its_projection_says():
    """Of a box the three faces that are seen, each by the cosine to the eye."""
    size = np.array([0.03, 0.02, 0.01])
    points = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * size
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    up = np.array([0.0, 1.0, 0.0])
    picture = np.asarray(Image.open(io.BytesIO(mesh_png({"a": (points, np.array(quads, dtype=np.int32))}, up=up))))
    eye = eye_axes(up, size)
    flat = points @ eye[:2].T
    scale = max(picture.shape[:2]) / (1.08 * np.ptp(flat, axis=0).max())
    area = np.abs(eye[2]) @ (size.prod() / size)
    assert (picture != 255).any(axis=2).sum() == pytest.approx(scale**2 * area, rel=0.01)
