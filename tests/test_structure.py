"""Holds the source to its size: short files and functions, and no cycles among the modules that import each other."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
Function = ast.FunctionDef | ast.AsyncFunctionDef
SOURCE = [path for folder in ("warp_mca", "kernels", "scenes") for path in sorted((ROOT / folder).rglob("*.py"))]
FILE_LINES, FUNCTION_LINES = 300, 60
LONG_FUNCTIONS = {
    "scenes/_arm.py arm",  # its parameters are its length, as are those of the scenes' build
    "scenes/single_link.py build",
    "scenes/three_link.py build",
    "scenes/two_link.py build",
}


@cache
def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def lines(function: Function, decorators: bool) -> set[int]:
    """Numbers of the lines of a function."""
    first = [mark.lineno for mark in function.decorator_list] if decorators else []
    return set(range(min([function.lineno, *first]), (function.end_lineno or 0) + 1))


def long_functions(tree: ast.AST) -> set[str]:
    """Names of functions that have too many lines of their own: those of functions within them count for these."""
    found = set()
    for function in (node for node in ast.walk(tree) if isinstance(node, Function)):
        own = lines(function, decorators=False)
        for inner in ast.walk(function):
            if isinstance(inner, Function) and inner is not function:
                own -= lines(inner, decorators=True)
        if len(own) > FUNCTION_LINES:
            found.add(function.name)
    return found


def test_a_long_function_is_seen_and_a_factory_of_short_ones_is_none():
    def source(name: str, count: int, indent: str = "") -> str:
        return f"{indent}def {name}():\n" + f"{indent}    x = 1\n" * count

    assert long_functions(ast.parse(source("f", FUNCTION_LINES))) == {"f"}
    factory = "def make():\n" + "".join(source(name, FUNCTION_LINES - 1, "    ") for name in "ab")
    assert long_functions(ast.parse(factory)) == set()


def test_files_are_short():
    count = {str(path.relative_to(ROOT)): len(path.read_text(encoding="utf-8").splitlines()) for path in SOURCE}
    assert [name for name, n in count.items() if n > FILE_LINES] == []


def test_functions_are_short():
    found = {f"{path.relative_to(ROOT)} {name}" for path in SOURCE for name in long_functions(tree_of(path))}
    assert found == LONG_FUNCTIONS


def modules() -> dict[str, Path]:
    """Files of the package by the names they are imported under; `kernels/` and `scenes/` are parts of it."""
    found = {}
    for folder in ("warp_mca", "kernels", "scenes"):
        prefix = () if folder == "warp_mca" else ("warp_mca",)
        for path in (ROOT / folder).rglob("*.py"):
            parts = (*prefix, *path.relative_to(ROOT).with_suffix("").parts)
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imported(node: ast.AST, names: set[str], types: bool = False) -> set[str]:
    """Modules of `names` that a tree imports, in functions as well; with `types` those of type checkers too."""
    found = set()
    for child in ast.iter_child_nodes(node):
        if not types and isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING":
            continue
        if isinstance(child, ast.Import):
            found |= {item.name for item in child.names} & names
        elif isinstance(child, ast.ImportFrom) and child.module:
            whole = {f"{child.module}.{item.name}" for item in child.names}
            found |= (whole & names) or ({child.module} & names)
        else:
            found |= imported(child, names, types)
    return found


def cycle(edges: dict[str, set[str]]) -> list[str]:
    """Nodes of a graph that lie on a cycle or lead from one to another, sorted."""
    left = {node: set(ends) - {node} for node, ends in edges.items()}
    while True:
        inner = {node for node in left if left[node] and any(node in ends for ends in left.values())}
        if inner == set(left):
            return sorted(left)
        left = {node: left[node] & inner for node in inner}


def test_a_cycle_is_seen():
    chain = {"a": {"b"}, "b": {"c"}, "c": set()}
    assert cycle(chain) == []
    assert cycle(chain | {"c": {"a"}, "d": {"a"}}) == ["a", "b", "c"]


def test_modules_import_each_other_in_one_direction():
    names = modules()
    assert len(names) > 100
    assert cycle({name: imported(tree_of(path), set(names)) for name, path in names.items()}) == []
