"""Holds the source to its own rules: signatures of kernels, who allocates, documented fields."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from typing import Any

import pytest
from test_structure import ROOT, tree_of

KERNEL_FILES = sorted((ROOT / "kernels").rglob("*.py"))
TEST_FILES = sorted((ROOT / "tests").glob("*.py"))
HOST_FILES = sorted([*(ROOT / "warp_mca").rglob("*.py"), *(ROOT / "scenes").glob("*.py")])
ALLOCATE = {"zeros", "ones", "empty", "full", "array", "clone", "zeros_like", "ones_like", "empty_like", "full_like"}
IN_PLACE = "spring"  # the one struct of arrays that kernels read and write


@cache
def structs() -> set[str]:
    """Names of classes of arrays that kernels take whole."""
    return {
        node.name
        for path in KERNEL_FILES
        for node in ast.walk(tree_of(path))
        if isinstance(node, ast.ClassDef) and any(ast.unparse(mark) == "wp.struct" for mark in node.decorator_list)
        if any(isinstance(field, ast.AnnAssign) and "wp.array" in ast.unparse(field.annotation) for field in node.body)
    }


def decorated(tree: ast.AST, *names: str) -> Iterator[Any]:
    """Functions and structs under @wp.<name> or @wp.<name>(...)."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            marks = [mark.func if isinstance(mark, ast.Call) else mark for mark in node.decorator_list]
            if any(ast.unparse(mark) in {f"wp.{name}" for name in names} for mark in marks):
                yield node


def parameters(function: ast.FunctionDef) -> dict[str, str]:
    """Annotation of each argument."""
    return {a.arg: ast.unparse(a.annotation) if a.annotation else "" for a in function.args.args}


@cache
def device_functions(*kinds: str) -> list[tuple[str, ast.FunctionDef]]:
    """Every function for the device of these kinds, under `file.name`."""
    return [
        (f"{path.stem}.{function.name}", function)
        for path in KERNEL_FILES
        for function in decorated(tree_of(path), *kinds)
    ]


def root(target: ast.expr) -> str:
    """The name that a chain of subscripts and attributes starts from."""
    while isinstance(target, ast.Subscript | ast.Attribute):
        target = target.value
    return target.id if isinstance(target, ast.Name) else ""


@cache
def outputs_of_functions() -> dict[str, list[int]]:
    """Which arguments each function of the kernels writes, by its name."""
    return {
        item.name: [k for k, name in enumerate(parameters(item)) if name.endswith("_out")]
        for _, item in [*device_functions("func_native"), *device_functions("kernel", "func")]
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
    assert len(device_functions("kernel")) >= 15
    assert {"Spring", "Patches"} <= structs()


def test_a_write_to_a_member_of_a_struct_is_seen():
    source = "@wp.kernel\ndef touch(patches: Patches, n: int):\n    patches.head[n] = 0\n"
    (function,) = decorated(ast.parse(source), "kernel")
    assert written(function) == {"patches"}


def test_outputs_are_named_and_come_last():
    wrong = []
    for label, kernel in device_functions("kernel"):
        names = list(parameters(kernel))
        outputs = [name for name in names if name.endswith("_out")]
        first = len(names) - len(outputs)
        last = names[first:] == outputs and (IN_PLACE not in names or names.index(IN_PLACE) == first - 1)
        if not last or not (outputs or IN_PLACE in names):
            wrong.append(label)
    assert wrong == []


def test_only_outputs_are_written():
    wrong = []
    for label, function in device_functions("kernel", "func"):
        names = parameters(function)
        arrays = {
            name for name, kind in names.items() if kind.startswith("wp.array") or kind.split(".")[-1] in structs()
        }
        outputs = {name for name in names if name.endswith("_out")}
        if not (written(function) & arrays <= outputs | {IN_PLACE} and outputs <= written(function)):
            wrong.append(label)
    assert wrong == []


def test_kernels_carry_no_adjoint():
    marks = {
        label: [ast.unparse(mark) for mark in kernel.decorator_list] for label, kernel in device_functions("kernel")
    }
    assert [label for label, mark in marks.items() if len(mark) != 1 or "enable_backward=False" not in mark[0]] == []


def test_kernel_files_allocate_nothing():
    wrong = []
    for path in KERNEL_FILES:
        nodes = list(ast.walk(tree_of(path)))
        types = {
            id(inner)
            for node in nodes
            if isinstance(node, ast.arg | ast.AnnAssign) and node.annotation
            for inner in ast.walk(node.annotation)
        }
        called = [node for node in nodes if isinstance(node, ast.Call)]
        views = {id(node) for node in called if "ptr" in {word.arg for word in node.keywords}}
        calls = [node.func for node in called if id(node) not in types | views]
        wrong += [
            f"{path.stem}, line {f.lineno}"
            for f in calls
            if (isinstance(f, ast.Attribute) and f.attr in ALLOCATE) or ast.unparse(f) == "wp.launch"
        ]
    assert wrong == []


def test_host_code_holds_no_kernels():
    found = {path.stem: [f.name for f in decorated(tree_of(path), "kernel", "func", "struct")] for path in HOST_FILES}
    assert {path: names for path, names in found.items() if names} == {}


def dataclasses() -> Iterator[tuple[str, ast.ClassDef]]:
    """Every public dataclass and device struct, under `file.name`."""
    for path in [*HOST_FILES, *KERNEL_FILES]:
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                marks = " ".join(ast.unparse(mark) for mark in node.decorator_list)
                if "dataclass" in marks or "wp.struct" in marks:
                    yield f"{path.stem}.{node.name}", node


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


def undocumented(cls: ast.ClassDef) -> str:
    """What the docstring of a class leaves out or says too much, empty where nothing."""
    doc = ast.get_docstring(cls) or ""
    names = fields(cls)
    if "Attributes:" not in doc:  # a class of few fields may say it in a sentence
        missing = [name for name in names if not re.search(rf"\b{name}\b", doc)]
        return f"{missing} undocumented" if len(names) > 4 and missing else ""
    listed = entries(doc)
    methods = {node.name for node in cls.body if isinstance(node, ast.FunctionDef)}
    if not set(names) <= set(listed) <= set(names) | methods:
        return f"{set(names) ^ set(listed)} undocumented or no field"
    arrays = [name for name, kind in names.items() if kind in ("Array", "Index") or kind.startswith("NDArray")]
    types = r"float64|float32|int32|uint16|uint8|bool"
    bare = [name for name in arrays if not re.search(types, listed[name])]
    return f"{bare} without dtype" if bare else ""


def test_every_field_is_documented():
    found = {label: undocumented(cls) for label, cls in dataclasses()}
    assert len(found) > 100
    assert {label: what for label, what in found.items() if what} == {}


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


def test_tests_read_the_state_and_leave_the_solver_alone():
    found = {
        path.stem: [what for what in patched(tree_of(path)) if re.search(r"\bSolver\b", what)] for path in TEST_FILES
    }
    assert {path: what for path, what in found.items() if what} == {}
