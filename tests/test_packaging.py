"""Tests that wheel and editable install offer the same packages, nothing but `warp_mca`, and a light import."""

from __future__ import annotations

import shutil
import subprocess
import sys
import sysconfig
import tomllib
import zipfile
from pathlib import Path, PurePosixPath

import pytest

ROOT = Path(__file__).resolve().parents[1]
MAPPING = {"warp_mca": "warp_mca", "warp_mca.kernels": "kernels", "warp_mca.scenes": "scenes"}
HEAVY = ("gmsh", "meshio", "pxr", "rerun", "matplotlib", "h5py", "scipy", "warp")


def modules_in_tree() -> set[str]:
    """Every module under warp_mca/, kernels/ and scenes/, by the name that it is imported by."""
    found = set()
    for package, folder in MAPPING.items():
        for path in (ROOT / folder).rglob("*.py"):
            parts = path.relative_to(ROOT / folder).with_suffix("").parts
            found.add(".".join((package, *parts)).removesuffix(".__init__"))
    return found


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of what a wheel is built from, so that building leaves no traces here."""
    copy = tmp_path_factory.mktemp("tree")
    for folder in MAPPING.values():
        shutil.copytree(ROOT / folder, copy / folder, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, copy / name)
    return copy


@pytest.fixture(scope="module")
def wheel(tree: Path) -> list[str]:
    """Names of the files in a wheel built without the network."""
    python(tree, "-m", "build", "--wheel", "--no-isolation", "--outdir", "dist")
    (path,) = (tree / "dist").glob("*.whl")
    return zipfile.ZipFile(path).namelist()


def python(folder: Path, *arguments: str) -> str:
    """What Python prints when run in that folder, which must not hold warp_mca unless it is meant to be found there."""
    done = subprocess.run([sys.executable, *arguments], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout.strip()


def test_every_folder_with_python_files_is_listed():
    packages = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]
    folders = {
        ".".join((package, *path.parent.relative_to(ROOT / folder).parts))
        for package, folder in MAPPING.items()
        for path in (ROOT / folder).rglob("*.py")
    }
    assert sorted(packages) == sorted(folders)


def test_the_wheel_holds_warp_mca_alone(wheel: list[str]):
    tops = {PurePosixPath(name).parts[0] for name in wheel}
    (version,) = (top for top in tops if top.endswith(".dist-info"))
    assert tops == {"warp_mca", version}
    assert {"warp_mca/py.typed", "warp_mca/accuracy/store.json"} <= set(wheel)
    assert any(name.endswith("licenses/LICENSE") for name in wheel)


def test_wheel_and_tree_have_the_same_modules(wheel: list[str]):
    files = {PurePosixPath(name) for name in wheel if name.endswith(".py")}
    assert {".".join(file.with_suffix("").parts).removesuffix(".__init__") for file in files} == modules_in_tree()


def test_an_editable_install_has_the_same_modules(tree: Path, tmp_path: Path):
    python(tree, "-c", f"from setuptools.build_meta import build_editable; build_editable({str(tmp_path)!r})")
    (path,) = tmp_path.glob("*.whl")
    site_folder = tmp_path / "site"
    zipfile.ZipFile(path).extractall(site_folder)
    # -S keeps this environment's own installation out; its libraries come back without it.
    code = (
        "import sys, site; libraries, folder, tree, *names = sys.argv[1:];"
        "site.addsitedir(folder); sys.path.append(libraries);"
        "from importlib.util import find_spec;"
        "print([n for n in names if not str(getattr(find_spec(n), 'origin', '')).startswith(tree)])"
    )
    places = sysconfig.get_path("purelib"), str(site_folder), str(tree)
    assert python(tmp_path, "-S", "-c", code, *places, *sorted(modules_in_tree())) == "[]"


def test_this_installation_has_the_same_modules(tmp_path: Path):
    code = "import sys; from importlib.util import find_spec; print([n for n in sys.argv[1:] if find_spec(n) is None])"
    assert python(tmp_path, "-c", code, *sorted(modules_in_tree())) == "[]"


def test_kernels_and_scenes_are_no_packages_of_their_own(tmp_path: Path):
    code = "from importlib.util import find_spec; print([n for n in ('kernels', 'scenes', 'tests') if find_spec(n)])"
    assert python(tmp_path, "-c", code) == "[]"


def test_the_import_is_light(tmp_path: Path):
    code = "import sys, warp_mca; print([name for name in sys.argv[1:] if name in sys.modules])"
    assert python(tmp_path, "-c", code, *HEAVY) == "[]"


def test_a_run_without_figures_imports_only_what_it_uses(tmp_path: Path):
    """Swing, impact and first peak, but no drawing; `scipy.signal`, with `scipy.stats`, takes half a second."""
    words = ["run", "two_link", "--refine=0.35", "--duration=1e-5", "--figures=none", "--quiet", "--out=o"]
    unused = [name for name in (*HEAVY, "scipy.signal", "scipy.stats") if name not in ("gmsh", "scipy", "warp")]
    code = (
        "import sys; from warp_mca.cli.main import main; main(sys.argv[1:]); print([n for n in {} if n in sys.modules])"
    )
    assert python(tmp_path, "-c", code.format(unused), *words) == "[]"
    assert {path.name for path in (tmp_path / "o").iterdir()} == {
        *("forces.npz", "history.csv", "paths.npz", "report.html", "summary.json")
    }


def test_every_public_name_can_be_had():
    import warp_mca

    assert [name for name in warp_mca.__all__ if not hasattr(warp_mca, name)] == []
