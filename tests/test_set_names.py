"""Node sets that a mesh does not have, or that cover no face, are refused with field, body and set."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import warp_mca as mca

STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)
BOX = mca.Box(size=(0.01, 0.01, 0.01), divisions=(1, 1, 1)).build()
MESH = replace(BOX, node_sets=BOX.node_sets | {"edge": BOX.node_sets["xmin"][:2], "none": np.zeros(0, np.int32)})
GOOD, WRONG = mca.Surface(body="a", nodes="xmax"), mca.Surface(body="b", nodes="tip")
WELD = {"name": "W", "body": "a", "other": "b"}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"fixed": (mca.Fixed(body="b", nodes="tip"),)}, "Fixed.nodes of body b, node set = 'tip': the mesh has edge,"),
        (
            {"fixed": (mca.Fixed(body="b", nodes="none"),)},
            "Fixed.nodes of body b, node set = 'none': no cell has a node of it",
        ),
        (
            {"prescribed": (mca.Prescribed(body="b", nodes="tip", axis="x", times=(0.0,), velocities=(0.0,)),)},
            "Prescribed.nodes of body b, node set = 'tip'",
        ),
        ({"absorbing": (mca.Absorbing(body="b", nodes="edge"),)}, "Absorbing.nodes of body b, node set = 'edge': it "),
        ({"joints": (mca.Weld(**WELD, nodes="tip", other_nodes="xmin"),)}, "Weld W.nodes of body a, node set = 'tip'"),
        (
            {"joints": (mca.Prismatic(**WELD, nodes="xmax", other_nodes="tip", axis=(1.0, 0.0, 0.0)),)},
            "Prismatic W.other_nodes of body b, node set = 'tip'",
        ),
        ({"contacts": (mca.Contact(slave=GOOD, master=WRONG),)}, "Contact.master.nodes of body b, node set = 'tip'"),
        ({"contacts": (mca.Contact(slave=WRONG, master=mca.RigidPlane()),)}, "Contact.slave.nodes of body b, node set"),
        ({"ties": (mca.Tie(slave=GOOD, master=WRONG),)}, "Tie a:xmax–b:tip.master.nodes of body b, node set = 'tip'"),
        ({"probes": (mca.Probe(name="p", body="b", nodes="tip"),)}, "Probe p.nodes of body b, node set = 'tip'"),
    ],
)
def test_a_set_that_is_not_there_is_named_with_its_body_and_field(change: dict[str, Any], said: str):
    bodies = tuple(mca.Body(name=name, geometry=MESH, material=STEEL) for name in "ab")
    scene = mca.Scene(name="sets", bodies=bodies, impact=mca.ImpactPhase(duration=1e-6), **change)
    with pytest.raises(mca.RequestError, match=f"^{re.escape(said)}"):
        mca.mesh(scene)


def test_points_outside_a_body_name_it():
    body = mca.Body(name="a", geometry=MESH, material=STEEL)
    line = mca.Line(body="a", start=(0.0, 0.0, 0.0), end=(0.02, 0.0, 0.0))
    for change, said in (
        ({"paths": (mca.Path(name="p", lines=(line,), spacing=0.01),)}, "0.01 m outside the body a; give points of it"),
        (
            {"probes": (mca.Probe(name="p", body="a", at=(0.0, 0.0, 0.02)),)},
            "0.01 m outside the body a; give one of it",
        ),
        (
            {"sections": (mca.Section(name="p", body="a", at=(1.0, 0.0, 0.0), normal=(1.0, 0.0, 0.0)),)},
            "leaves all of body a on one side",
        ),
    ):
        with pytest.raises(mca.RequestError, match=said):
            mca.run(mca.Scene(name="sets", bodies=(body,), impact=mca.ImpactPhase(duration=1e-6), **change))


def test_a_scene_file_that_fails_names_its_line(tmp_path: Path):
    file = tmp_path / "broken.py"
    file.write_text("import warp_mca\n\nx = 1 / 0\n", encoding="utf-8")
    with pytest.raises(mca.RequestError, match=r"reading the file failed: ZeroDivisionError: .* \(line 3\)$"):
        mca.make_scene(file)
