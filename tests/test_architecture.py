"""docs/architecture.md says what the code is: folders and their imports, stages of a step, arrays of the state."""

from __future__ import annotations

import ast
import inspect
import re
from dataclasses import replace
from pathlib import Path

from chains import BASE, TORQUE, bars
from chains import ready as chain_ready
from impacts import prepared
from test_structure import imported, modules, tree_of
from test_style import entries

import warp_mca as mca
from warp_mca.physics.absorbing.stage import AbsorbingState
from warp_mca.physics.contact.contact_state import ContactState
from warp_mca.physics.elements.failing import FailureState
from warp_mca.physics.elements.state import ElementState
from warp_mca.physics.floating.frames import with_floating_frames
from warp_mca.physics.floating.stage import FloatingState
from warp_mca.physics.joints.constraint_stage import ConstraintState
from warp_mca.physics.joints.coupling_stage import CouplingState
from warp_mca.physics.loads.stage import LoadState
from warp_mca.physics.rigid.joint_arrays import JointState
from warp_mca.physics.rigid.stage import RigidState
from warp_mca.step.solver import Solver
from warp_mca.system.state import State

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7800.0)


def section(title: str) -> str:
    return PAGE.split(f"\n## {title}\n")[1].split("\n## ")[0]


def table(title: str) -> list[list[str]]:
    """Cells of the rows of the section's first table."""
    rows = re.findall(r"^\|(.*)\|$", section(title), flags=re.M)
    return [[cell.strip() for cell in row.split("|")] for row in rows[2:]]


def folder(module: str) -> str:
    """The part of the package that a module belongs to; empty for modules beside the folders."""
    parts = module.split(".")
    return parts[1] if len(parts) > 2 else ""


def imports_of_folders() -> set[tuple[str, str]]:
    """Pairs of folders of which the first imports from the second; "" is the package itself, with its public names."""
    names = modules()
    packages = {folder(name) for name in names} - {""}
    part = lambda name: folder(name) or (name.removeprefix("warp_mca.") if name[9:] in packages else "")  # noqa: E731
    found = {
        (part(name), part(other))
        for name, path in names.items()
        for other in imported(tree_of(path), set(names), types=True)
    }
    return {(importer, other) for importer, other in found if importer and importer != other}


def test_folders_are_layers():
    """A folder imports only from folders above it in the table; the public names stand before `scenes/`."""
    order = [cells[0].strip("`/") for cells in table("Folders")]
    found = imports_of_folders()
    assert sorted(order) == sorted({importer for importer, _ in found} | {"base"})
    order.insert(order.index("scenes"), "")
    upward = {(importer, other) for importer, other in found if order.index(other) > order.index(importer)}
    assert upward == set()


def defined(tree: ast.Module) -> set[str]:
    """Functions and classes of a file, and fields and methods of its classes as `Class.name`."""
    nodes = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.ClassDef)]
    found = {node.name for node in nodes}
    for owner in nodes:
        for item in owner.body if isinstance(owner, ast.ClassDef) else ():
            if isinstance(item, ast.FunctionDef):
                found.add(f"{owner.name}.{item.name}")
            if isinstance(item, ast.AnnAssign):
                found.add(f"{owner.name}.{ast.unparse(item.target)}")
    return found


def test_functions_that_the_page_names_exist():
    """Every `file.py`, `Name` of the page is a file with that name defined in it."""
    named = re.findall(r"`([\w/]+\.py)`, `([\w.]+)`", PAGE)
    assert len(named) > 12
    for file, name in named:
        path = ROOT / file if file.startswith("kernels/") else ROOT / "warp_mca" / file
        assert name in defined(tree_of(path)), f"{file} has no {name}"


def everything() -> mca.Scene:
    """A scene with each kind of thing that acts: contact, hinge, rail, driven node, absorbing side, tie, rigid one."""
    rail = mca.Box(size=(0.1, 0.02, 0.01), divisions=(10, 4, 2), origin=(0.0, -0.01, -0.01))
    cart = mca.Box(size=(0.02, 0.01, 0.01), divisions=(2, 2, 2), origin=(0.01, -0.005, 0.0))
    wall = mca.RigidPlane(point=(0.04, 0.0, 0.0), normal=(-1.0, 0.0, 0.0))
    on_rail = {"body": "cart", "nodes": "zmin", "other": "rail", "other_nodes": "zmax", "axis": (1.0, 0.0, 0.0)}
    return mca.Scene(
        name="everything",
        bodies=tuple(
            mca.Body(
                name=name,
                geometry=rail if name == "rail" else cart,
                material=STEEL,
                position=(0.0, 0.0, z),
                rigid=name == "rigid",
            )
            for name, z in (
                ("rail", 0.0),
                ("cart", 0.0),
                ("driven", 0.1),
                ("carrier", 0.21),
                ("tied", 0.2),
                ("rigid", 0.3),
            )
        ),
        joints=(
            mca.Prismatic(name="P", **on_rail),
            mca.Weld(name="W", body="rail", nodes="zmin"),
            mca.Cylindrical(name="C", body="rigid", axis=(1.0, 0.0, 0.0)),
        ),
        prescribed=(mca.Prescribed(body="driven", nodes="xmax", axis="x", times=(0.0,), velocities=(0.0,)),),
        absorbing=(mca.Absorbing(body="carrier", nodes="zmax"),),
        contacts=(mca.Contact(slave=mca.Surface(body="cart", nodes="zmax"), master=wall),),
        ties=(mca.Tie(slave=mca.Surface(body="tied", nodes="zmax"), master=mca.Surface(body="carrier", nodes="zmin")),),
        impact=mca.ImpactPhase(duration=1e-5),
    )


def test_stages_of_a_step_are_those_of_the_page_in_this_order():
    page = [cells[:4] for cells in table("Stages of a step")]
    driven = bars(torques=(TORQUE,), base_motion=BASE)
    pin = mca.Revolute(name="A", body="cart", at=(0.02, 0.0, 0.005), nodes="pin", pin_radius=0.01)
    pinned = replace(everything(), joints=(pin,))
    seen = set()
    turning = with_floating_frames(prepared(pinned).model, [pinned], 1.0, "mixed")
    weak = replace(STEEL, failure=mca.PrincipalStressFailure(stress=1e9))
    (driven_body,) = (body for body in everything().bodies if body.name == "driven")
    lone = mca.Scene(name="failing", bodies=(replace(driven_body, material=weak),), impact=everything().impact)
    failing = prepared(lone).model
    for model in (prepared(everything()).model, turning, chain_ready(driven).model, failing):
        solver = Solver(model, device="cpu", precision="mixed", dt=1e-8)
        found = [
            [str(number), stage.name, stage.stream, "with a record" if stage.only_records else "all"]
            for number, group in enumerate(solver.groups)
            for stage in group
        ]
        assert [cells for cells in page if cells in found] == found
        seen |= {tuple(cells) for cells in found}
    assert seen == {tuple(cells) for cells in page}


STATE_PARTS = {
    "": State,
    "elements/0/": ElementState,
    "elements/0/failing/": FailureState,
    "contacts/0/": ContactState,
    "constraints/": ConstraintState,
    "couplings/": CouplingState,
    "loads/": LoadState,
    "absorbing/": AbsorbingState,
    "rigid/": RigidState,
    "rigid/joints/": JointState,
    "floating/": FloatingState,
}


def test_the_page_says_of_each_array_of_the_state_what_its_docstring_says():
    rows = [
        [f"`{prefix}{name}`", text.strip()]
        for prefix, cls in STATE_PARTS.items()
        for name, text in entries(inspect.cleandoc(cls.__doc__ or "")).items()
    ]
    assert len(rows) > 20
    assert table("State") == rows


FOLDERS = ["", "warp_mca/", *(f"kernels/{name}/" for name in ("elements", "materials", "contact"))]


def test_files_that_contributors_are_sent_to_exist():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`([\w./]+(?:\.py|\.md|\.toml|/))`|\]\(([^):]+)\)", text))
    paths = {path for pair in named for path in pair if path}
    assert len(paths) > 30
    assert [path for path in paths if not any((ROOT / folder / path).exists() for folder in FOLDERS)] == []


def test_tables_that_contributors_are_sent_to_hold_what_the_package_has():
    """Each of the six tasks names a table of the code, in the file that it gives, and a test that exists."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (material|element|contact law|joint|load|recorder) \|(.*)\|$", text, flags=re.M)
    assert len(rows) == 6
    for name, row in rows:
        _, line, test = row.split("|")
        ((constant, path),) = re.findall(r"`([A-Z_]+)` in `([\w/.]+)`", line)
        assert re.search(rf"^{constant}\b.*= \{{", (ROOT / path).read_text(encoding="utf-8"), flags=re.M), name
        assert all((ROOT / file).exists() for file in re.findall(r"`(tests/\w+\.py)`", test))
