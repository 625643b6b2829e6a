"""Holds the source to its own rules: signatures of kernels, who allocates, documented fields."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
KERNEL_FILES = sorted((ROOT / "kernels").rglob("*.py"))
TEST_FILES = sorted((ROOT / "tests").glob("*.py"))
HOST_FILES = sorted([*(ROOT / "warp_mca").rglob("*.py"), *(ROOT / "scenes").glob("*.py")])
ALLOCATE = {"zeros", "ones", "empty", "full", "array", "clone", "zeros_like", "ones_like", "empty_like", "full_like"}
IN_PLACE = "spring"  # the one struct of arrays that kernels read and write
STRUCTS = {  # classes of arrays that kernels take whole
    node.name
    for path in KERNEL_FILES
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    if isinstance(node, ast.ClassDef) and any(ast.unparse(mark) == "wp.struct" for mark in node.decorator_list)
    if any(isinstance(field, ast.AnnAssign) and "wp.array" in ast.unparse(field.annotation) for field in node.body)
}


def parse(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def decorated(tree: ast.AST, *names: str) -> Iterator[ast.FunctionDef]:
    """Functions under @wp.<name> or @wp.<name>(...)."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            marks = [mark.func if isinstance(mark, ast.Call) else mark for mark in node.decorator_list]
            if any(ast.unparse(mark) in {f"wp.{name}" for name in names} for mark in marks):
                yield node


def parameters(function: ast.FunctionDef) -> dict[str, str]:
    """Annotation of each argument."""
    return {a.arg: ast.unparse(a.annotation) if a.annotation else "" for a in function.args.args}


def device_functions() -> list:
    """Every kernel and function for the device, named by file."""
    return [
        pytest.param(function, id=f"{path.stem}.{function.name}")
        for path in KERNEL_FILES
        for function in decorated(parse(path), "kernel", "func")
    ]


def kernels() -> list:
    return [item for item in device_functions() if list(decorated(ast.Module([item.values[0]], []), "kernel"))]


def root(target: ast.expr) -> str:
    """The name that a chain of subscripts and attributes starts from."""
    while isinstance(target, ast.Subscript | ast.Attribute):
        target = target.value
    return target.id if isinstance(target, ast.Name) else ""


@cache
def outputs_of_functions() -> dict[str, list[int]]:
    """Which arguments each function of the kernels writes, by its name."""
    native = [f for path in KERNEL_FILES for f in decorated(parse(path), "func_native")]
    return {
        item.name: [k for k, name in enumerate(parameters(item)) if name.endswith("_out")]
        for item in [*native, *(item.values[0] for item in device_functions())]
    }


def written(function: ast.FunctionDef) -> set[str]:
    """Names that the function writes through: assigned entries, atomics, and outputs of the functions it calls."""
    found = set()
    for node in ast.walk(function):
        if isinstance(node, ast.Assign | ast.AugAssign):
            for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
                parts = target.elts if isinstance(target, ast.Tuple) else [target]
                found |= {root(part) for part in parts if isinstance(part, ast.Subscript | ast.Attribute)}
                if isinstance(target, ast.Attribute) and root(target).endswith("_out"):  # a struct of outputs
                    found.add(root(node.value))
        if isinstance(node, ast.Call):
            name = ast.unparse(node.func)
            places = [0] if name.startswith("wp.atomic") else outputs_of_functions().get(name, [])
            found |= {root(node.args[k]) for k in places}
    return found


def test_there_are_kernels_to_look_at():
    assert len(kernels()) >= 15
    assert {"Spring", "Patches"} <= STRUCTS


def test_a_write_to_a_member_of_a_struct_is_seen():
    source = "@wp.kernel\ndef touch(patches: Patches, n: int):\n    patches.head[n] = 0\n"
    (function,) = decorated(ast.parse(source), "kernel")
    assert written(function) == {"patches"}


@pytest.mark.parametrize("kernel", kernels())
def test_outputs_are_named_and_come_last(kernel: ast.FunctionDef):
    names = list(parameters(kernel))
    outputs = [name for name in names if name.endswith("_out")]
    assert outputs or IN_PLACE in names
    assert names[len(names) - len(outputs) :] == outputs
    if IN_PLACE in names:
        assert names.index(IN_PLACE) == len(names) - len(outputs) - 1


@pytest.mark.parametrize("function", device_functions())
def test_only_outputs_are_written(function: ast.FunctionDef):
    names = parameters(function)
    arrays = {name for name, kind in names.items() if kind.startswith("wp.array") or kind.split(".")[-1] in STRUCTS}
    outputs = {name for name in names if name.endswith("_out")}
    assert written(function) & arrays <= outputs | {IN_PLACE}
    assert outputs <= written(function)


@pytest.mark.parametrize("kernel", kernels())
def test_kernels_carry_no_adjoint(kernel: ast.FunctionDef):
    (mark,) = [ast.unparse(mark) for mark in kernel.decorator_list]
    assert "enable_backward=False" in mark


@pytest.mark.parametrize("path", KERNEL_FILES, ids=lambda path: path.stem)
def test_kernel_files_allocate_nothing(path: Path):
    tree = parse(path)
    types = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.arg | ast.AnnAssign) and node.annotation
        for inner in ast.walk(node.annotation)
    }
    views = {id(n) for n in ast.walk(tree) if isinstance(n, ast.Call) and "ptr" in {k.arg for k in n.keywords}}
    skip = types | views
    calls = [node.func for node in ast.walk(tree) if isinstance(node, ast.Call) and id(node) not in skip]
    assert not [f"line {f.lineno}" for f in calls if isinstance(f, ast.Attribute) and f.attr in ALLOCATE]
    assert not [f"line {f.lineno}" for f in calls if ast.unparse(f) == "wp.launch"]


@pytest.mark.parametrize("path", HOST_FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_host_code_holds_no_kernels(path: Path):
    assert not [function.name for function in decorated(parse(path), "kernel", "func", "struct")]


def dataclasses() -> list:
    """Every public dataclass and device struct."""
    found = []
    for path in [*HOST_FILES, *KERNEL_FILES]:
        for node in ast.walk(parse(path)):
            marks = " ".join(ast.unparse(mark) for mark in getattr(node, "decorator_list", []))
            public = isinstance(node, ast.ClassDef) and not node.name.startswith("_")
            if public and ("dataclass" in marks or "wp.struct" in marks):
                found.append(pytest.param(node, id=f"{path.stem}.{node.name}"))
    return found


def fields(cls: ast.ClassDef) -> dict[str, str]:
    return {
        node.target.id: ast.unparse(node.annotation)
        for node in cls.body
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and not node.target.id.startswith("_")
    }


def entries(doc: str) -> dict[str, str]:
    """What the Attributes section says of each name; an entry may list several names."""
    _, _, section = doc.partition("Attributes:\n")
    found: dict[str, str] = {}
    names: list[str] = []
    for line in section.splitlines():
        if line and not line.startswith("    "):
            break
        head = re.match(r"    ((?:\w+, )*\w+): ?(.*)", line)
        if head:
            names = head[1].split(", ")
            found |= dict.fromkeys(names, "")
        for name in names:
            found[name] += (head[2] if head else line.strip()) + " "
    return found


@pytest.mark.parametrize("cls", dataclasses())
def test_every_field_is_documented(cls: ast.ClassDef):
    doc = ast.get_docstring(cls) or ""
    names = fields(cls)
    if "Attributes:" not in doc:  # a class of few fields may say it in a sentence
        assert len(names) <= 4 or all(re.search(rf"\b{name}\b", doc) for name in names)
        return
    listed = entries(doc)
    assert set(names) <= set(listed)
    methods = {node.name for node in cls.body if isinstance(node, ast.FunctionDef)}
    assert set(listed) <= set(names) | methods
    for name, kind in names.items():
        if kind in ("Array", "Index") or kind.startswith("NDArray"):
            assert re.search(r"float64|float32|int32|uint16|uint8|bool", listed[name]), f"{name} has no dtype"


def patched(tree: ast.AST) -> Iterator[str]:
    """What attributes are set of: by setattr and patch, of a class by name or by path, and by assignment."""
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Call)
            and node.args
            and re.search(r"\b(setattr|delattr|patch)\b", ast.unparse(node.func))
        ):
            yield ast.unparse(node.args[0])
        if isinstance(node, ast.Assign | ast.AugAssign):
            for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
                if isinstance(target, ast.Attribute):
                    yield ast.unparse(target.value)


@pytest.mark.parametrize(
    "source",
    [
        "monkeypatch.setattr(solver.Solver, 'start', None)",
        "patch.setattr('warp_mca.step.solver.Solver.start', None)",
        "with patch.object(Solver, 'start'): pass",
        "Solver.start = None",
    ],
)
def test_a_patch_of_the_solver_is_seen(source: str):
    assert "Solver" in "".join(patched(ast.parse(source)))


@pytest.mark.parametrize("path", TEST_FILES, ids=lambda path: path.stem)
def test_tests_read_the_state_and_leave_the_solver_alone(path: Path):
    assert not [what for what in patched(parse(path)) if re.search(r"\bSolver\b", what)]
