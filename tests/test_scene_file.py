"""Tests that a model file gives back the scene and meshes that went into it, and what may be changed afterwards."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.base.errors import RequestError
from warp_mca.geometry import Mesh
from warp_mca.scene.catalogue import load_source, make_scene, scene_names
from warp_mca.scene.model_file import Origin, changed, load, save


def cube(edge: float = 1.0) -> Mesh:
    """One element [m]."""
    return mca.Box(size=(edge,) * 3, divisions=(1, 1, 1)).build()


def stand_ins(scene: mca.Scene) -> dict[str, Mesh]:
    """A cube in place of each body's mesh: what is stored does not matter here."""
    return {body.name: cube(1.0 + i) for i, body in enumerate(scene.bodies)}


def stored(path: Path, name: str = "two_link"):
    """A model file of a built-in scene, written and read again."""
    source = load_source(name)
    values = source.resolve()
    scene = source.build(values)
    save(path, scene, stand_ins(scene), Origin(name, source.default_preset, values))
    return scene, load(path)


def without_meshes(scene: mca.Scene) -> mca.Scene:
    """The scene with a box in place of each finished mesh, whose arrays have no truth value of their own."""
    box = mca.Box(size=(1.0, 1.0, 1.0), divisions=(1, 1, 1))
    bodies = (dataclasses.replace(b, geometry=box) if isinstance(b.geometry, Mesh) else b for b in scene.bodies)
    return dataclasses.replace(scene, bodies=tuple(bodies))


@pytest.mark.parametrize("name", scene_names())
def test_a_built_in_scene_comes_back_equal(tmp_path: Path, name: str):
    scene, model = stored(tmp_path / "m.mca", name)
    assert without_meshes(model.scene) == without_meshes(scene)
    assert model.origin == Origin(name, load_source(name).default_preset, dict(scene.parameters))
    for body, mesh in stand_ins(scene).items():
        np.testing.assert_array_equal(model.meshes[body].points, mesh.points)
        np.testing.assert_array_equal(model.meshes[body].hexahedra, mesh.hexahedra)
        assert model.meshes[body].hexahedra.dtype == np.int32
        assert model.meshes[body].node_sets.keys() == mesh.node_sets.keys()
        np.testing.assert_array_equal(model.meshes[body].node_sets["xmax"], mesh.node_sets["xmax"])


def everything() -> mca.Scene:
    """A scene with every class of the vocabulary in it, and a mesh made elsewhere."""
    soft = mca.J2Bilinear(E=1e9, nu=0.3, rho=1e3, sigma_y=1e6, E_t=1e8, beta=0.5)
    material = {"body": soft, "*": mca.Elastic(E=0.1 + 0.2, nu=-0.5, rho=np.float64(1 / 3))}
    box = mca.Box(size=(1.0, 1.0, 1.0), divisions=(1, 1, 1))
    top = mca.Surface(body="b", nodes="ymax")
    return mca.Scene(
        name="all",
        bodies=(
            mca.Body(name="a", geometry=box, material=material, velocity=(1e-300, -0.0, 5e-324)),
            mca.Body(name="b", geometry=cube(2.0), material=soft),
        ),
        impact=mca.ImpactPhase(duration=1e-3),
        rigid=mca.RigidPhase(
            theta=(0.1,),
            theta_dot=(0.2,),
            tip=mca.Tip(body="a", centre=(0.0, 0.0, 0.0), radius=0.1),
            target=top,
            base_motion=mca.BaseMotion(times=(0.0, 1.0), vx=(0.0, 2.0), vy=(0.1, 0.0)),
            slide=mca.Slide(carriage_mass=0.2),
            torques=(mca.JointTorque(joint="O", times=(0.0,), torques=(0.3,)),),
        ),
        joints=(mca.Revolute(name="O", body="a", at=(0.0, 0.0, 0.0)),),
        contacts=(
            mca.Contact(slave=mca.Surface(body="a", nodes="ymin"), master=top, mu=0.3, two_way=True),
            mca.Contact(
                slave=mca.Surface(body="a", nodes="ymin"),
                master=mca.RigidPlane(),
                name="floor",
                normal=(0.0, 1.0, 0.1),
                tangent=(1.0, 0.0, 0.0),
            ),
        ),
        fixed=(mca.Fixed(body="b", nodes="ymin", axes="yz"),),
        prescribed=(mca.Prescribed(body="b", nodes="xmin", axis="x", times=(0.0, 1.0), velocities=(0.0, 2.0)),),
        gravity=(0.0, -9.81, 0.0),
        tip=mca.Point(body="a", at=(0.0, 0.0, 0.0)),
        parameters={"mu": 0.3, "kind": "x", "on": True, "n": 3},
    )


def test_every_class_of_the_vocabulary_comes_back_equal(tmp_path: Path):
    scene = everything()
    save(tmp_path / "m.mca", scene, {"a": cube(), "b": scene.body("b").geometry})
    model = load(tmp_path / "m.mca")
    assert model.origin is None
    assert model.scene.body("a") == scene.body("a")
    for name in ("impact", "rigid", "joints", "contacts", "fixed", "prescribed", "gravity", "tip", "parameters"):
        assert getattr(model.scene, name) == getattr(scene, name), name
    np.testing.assert_array_equal(model.scene.body("b").geometry.points, scene.body("b").geometry.points)


def test_a_recipe_of_one_s_own_is_stored_as_its_mesh(tmp_path: Path):
    @dataclass(frozen=True)
    class Mine:
        def build(self) -> Mesh:
            return cube(3.0)

    body = mca.Body(name="b", geometry=Mine(), material=mca.Elastic(E=1e9, nu=0.3, rho=1e3))
    scene = mca.Scene(name="mine", bodies=(body,), impact=mca.ImpactPhase(duration=1e-3))
    save(tmp_path / "m.mca", scene, {"b": Mine().build()})
    geometry = load(tmp_path / "m.mca").scene.body("b").geometry
    assert isinstance(geometry, Mesh)
    assert geometry.points.max() == 3.0


def test_parameters_that_leave_the_mesh_alone_can_be_changed(tmp_path: Path):
    _, model = stored(tmp_path / "m.mca")
    other = changed(model, {"mu": "0.1", "v_plate": "0.8", "E_tip": "7e10"})
    assert other.scene == make_scene("two_link", mu=0.1, v_plate=0.8, E_tip=7e10)
    assert other.meshes is model.meshes
    assert changed(model, {}) is model


@pytest.mark.parametrize("setting", [{"radius": "0.012"}, {"plate_width": "0.2"}])
def test_parameters_that_change_the_mesh_ask_for_a_new_build(tmp_path: Path, setting: dict[str, str]):
    _, model = stored(tmp_path / "m.mca")
    with pytest.raises(RequestError, match=f"{next(iter(setting))}.*build the model again"):
        changed(model, setting)


def test_only_built_in_scenes_can_be_changed(tmp_path: Path):
    scene = everything()
    save(tmp_path / "m.mca", scene, stand_ins(scene))
    with pytest.raises(RequestError, match="built-in"):
        changed(load(tmp_path / "m.mca"), {"mu": "0.1"})


def test_loading_needs_no_mesh_library(tmp_path: Path):
    stored(tmp_path / "m.mca")
    code = (
        "import sys; from warp_mca.scene.model_file import load; load(sys.argv[1]);"
        "print([m for m in ('gmsh', 'meshio', 'pxr', 'rerun', 'warp') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code, str(tmp_path / "m.mca")], capture_output=True, text=True)
    assert done.stdout.strip() == "[]", done.stderr


def test_a_failed_write_keeps_the_older_file_and_nothing_else(tmp_path: Path):
    stored(tmp_path / "m.mca")
    before = (tmp_path / "m.mca").read_bytes()
    broken = {body.name: object() for body in make_scene("two_link").bodies}
    with pytest.raises(TypeError):
        save(tmp_path / "m.mca", make_scene("two_link"), broken)  # type: ignore[arg-type]
    assert (tmp_path / "m.mca").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["m.mca"]


@pytest.mark.parametrize("damage", ["text", "cut", "foreign", "class", "mesh", "locked", "token", "shape", "missing"])
def test_a_file_that_is_no_model_is_refused(tmp_path: Path, damage: str):
    path = tmp_path / "m.mca"
    if damage == "text":
        path.write_text("hello")
    elif damage == "foreign":
        np.savez(path.open("wb"), points=np.zeros(3))
    elif damage == "class":
        header = b'{"format": "warp_mca model 1", "scene": {"$type": "Popen"}, "meshes": {}, "origin": null}'
        np.savez(path.open("wb"), header=np.frombuffer(header, dtype=np.uint8))
    elif damage == "mesh":
        stored(path)
        with np.load(path) as archive:
            content = json.loads(archive["header"].tobytes())
        content["meshes"] = dict.fromkeys(content["meshes"])
        np.savez(path.open("wb"), header=np.frombuffer(json.dumps(content).encode(), dtype=np.uint8))
    elif damage == "locked":
        stored(path)
        damaged = bytearray(path.read_bytes())
        for mark, flag in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
            start = -1
            while (start := damaged.find(mark, start + 1)) >= 0:
                damaged[start + flag] |= 1  # encrypted, it says
        path.write_bytes(damaged)
    elif damage in ("token", "shape"):  # in the header of an array, which is read before its checksum
        np.save(tmp_path / "a.npy", np.zeros(3, dtype=np.uint8))
        old, new = {"token": (b"}", b" "), "shape": (b"(3,), }             ", b"(9999999999999999,)}")}[damage]
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("header.npy", (tmp_path / "a.npy").read_bytes().replace(old, new))
    elif damage == "cut":
        stored(path)
        path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(RequestError, match="no such file" if damage == "missing" else "damaged") as error:
        load(path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["m.npz", "nowhere/m.mca"])
def test_where_a_model_file_may_not_go(tmp_path: Path, name: str):
    scene = everything()
    with pytest.raises(RequestError, match="output"):
        save(tmp_path / name, scene, stand_ins(scene))
    assert list(tmp_path.iterdir()) == []


def bomb(path: Path, count: int) -> None:
    """A model file whose mesh has so many points, all at the origin."""
    header = json.dumps({"format": "warp_mca model 1", "scene": {}, "meshes": {}, "origin": None}).encode()
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        np.save(archive.open("header.npy", "w"), np.frombuffer(header, dtype=np.uint8))
        with archive.open("array0.npy", "w", force_zip64=True) as entry:
            np.lib.format.write_array_header_1_0(entry, {"descr": "<f8", "fortran_order": False, "shape": (count, 3)})
            for _ in range(24 * count >> 20):
                entry.write(bytes(1 << 20))


def test_a_file_that_would_unpack_to_far_more_than_it_holds_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """3 MB took 3.5 GB of memory."""
    bomb(tmp_path / "m.mca", 8 << 20)
    monkeypatch.setattr(np, "load", lambda *args, **options: pytest.fail("unpacked"))
    with pytest.raises(RequestError, match=r"it would unpack to 0\.2 GB, 1\d\d\d times its size, unlike meshes"):
        load(tmp_path / "m.mca")


def test_a_file_that_memory_does_not_hold_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    stored(tmp_path / "m.mca")
    monkeypatch.setattr("warp_mca.scene.model_file._free_memory", lambda: 1e3)
    with pytest.raises(RequestError, match=r"GB of memory, of which 1e-06 GB are free"):
        load(tmp_path / "m.mca")


def test_parameters_of_any_kind_are_stored_as_their_text(tmp_path: Path):
    scene = dataclasses.replace(everything(), parameters={"share": Path("a/b"), "n": 3})
    save(tmp_path / "m.mca", scene, stand_ins(scene))
    assert load(tmp_path / "m.mca").scene.parameters == {"share": "a/b", "n": 3}
