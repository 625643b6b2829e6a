"""Owns the meshes of a scene's bodies: each recipe meshed once, checked, cut where a formulation asks for it."""

from __future__ import annotations

import re
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from itertools import islice

from warp_mca.base import validate
from warp_mca.base.errors import RequestError, bad_value
from warp_mca.base.kept import Kept
from warp_mca.geometry.cell_types import CELL_TYPES
from warp_mca.geometry.degenerate import among, cut_to
from warp_mca.geometry.mesh import Mesh
from warp_mca.geometry.refinement import refined
from warp_mca.geometry.shape_volume import built
from warp_mca.phases.arguments import check_scene
from warp_mca.physics.elements import ELEMENTS, default_element
from warp_mca.physics.elements.cells import with_carriers
from warp_mca.scene import Body, Scene

ALIKE = 8  # meshes made last, among which one is looked for that has the same cells
_PACKAGE = Mesh.__module__.rpartition(".")[0]
_KEPT: Kept[Mesh] = Kept(500_000)  # cells of meshes that recipes gave to runs of this process, 50 MB of memory


def mesh(
    scene: Scene, made: dict[object, Mesh] | None = None, given: Mapping[str, Mesh] | None = None
) -> dict[str, Mesh]:
    """The mesh of every body, checked.

    Args:
        scene: whose bodies to mesh.
        made: meshes by recipe, for scenes that share some; those made here are added. Callers who give it change no
            mesh, so that recipes of the package are meshed once in a process.
        given: finished meshes by body, in place of the bodies' own geometry.

    Raises:
        RequestError: an element is inverted, a mesh is not whole or not given, a recipe or file cannot be turned into a
            mesh, or an element was chosen that no body can take.
    """
    from warp_mca.geometry.quality import check

    check_scene("scene", scene)
    if given is not None:
        validate.kind_of("meshes", given, Mapping, "give a Mesh for each body by its name, as mca.mesh makes them")
    meshes = {}
    keep, made = made is not None, {} if made is None else made
    for body in scene.bodies:
        if given is not None and body.name not in given:
            raise bad_value("meshes", list(given), f"give a mesh of body {body.name} too")
        geometry = _geometry(scene, body) if given is None else given[body.name]
        if given is not None:
            validate.kind_of(f"meshes[{body.name!r}]", geometry, Mesh, "give a finished Mesh, as mca.mesh makes it")
        key = _key(geometry)
        known = _KEPT.get(key) if keep and _plain(geometry) else None
        if known is not None:
            made.setdefault(key, known)
        if key not in made:
            made[key] = geometry if isinstance(geometry, Mesh) else _build(scene, body, geometry)
            if _plain(geometry):
                made[key].share_faces(islice(reversed(tuple(made.values())), 1, ALIKE))
            check(made[key], body.name)
            if keep and _plain(geometry):
                _KEPT.put(key, made[key], made[key].cell_count)
        meshes[body.name] = made[key]
    cut = _cut(scene, meshes)
    _check_elements(scene, cut)
    for name, item in cut.items():
        if item is not meshes[name]:  # a hexahedron with a folded corner may give an inverted tetrahedron
            check(item, name)
    cut = {body.name: with_carriers(body, cut[body.name]) for body in scene.bodies}
    for field, body, name, covers in scene.named_sets():
        _check_set(field, body, name, cut[body], covers)
    return cut


class Shared:
    """Meshes that were made, for bodies of other scenes with equal recipes."""

    def __init__(self, scenes: Sequence[Scene], made: Mapping[object, Mesh]) -> None:
        """Those of the scenes, `made` as `mesh` gives it."""
        self._found: dict[object, tuple[object, Mesh]] = {}
        for scene in scenes:
            for body in scene.bodies:
                key = _key(_geometry(scene, body))
                if key in made and not isinstance(key, _Itself):
                    self._found[scene.refine, _key(body.geometry)] = key, made[key]

    def of(self, scene: Scene) -> dict[object, Mesh]:
        """Those of a scene's bodies, by recipe."""
        keys = [(scene.refine, _key(body.geometry)) for body in scene.bodies]
        return dict(self._found[key] for key in keys if key in self._found)


def _check_set(field: str, body: str, name: str, mesh: Mesh, covers: bool) -> None:
    """Refuse a node set that the mesh of a body does not have, or that does not cover faces where it must.

    Raises:
        RequestError: so it is.
    """
    try:
        mesh.surface(name) if covers else mesh.nodes(name)
    except RequestError as error:
        raise RequestError(f"{field} of body {body}, {error}") from error


def _geometry(scene: Scene, body: Body) -> object:
    """The mesh or recipe of a body, finer or coarser where the scene asks for it.

    Raises:
        RequestError: it cannot be made so.
    """
    if scene.refine == 1.0:
        return body.geometry
    try:
        return refined(f"body {body.name}", body.geometry, scene.refine)
    except RequestError as error:
        raise _of_refine(scene, body, error) from error


def _build(scene: Scene, body: Body, geometry: object) -> Mesh:
    """The mesh of a recipe, which may be the user's own.

    Raises:
        RequestError: its `build` failed or returned something else than a mesh.
    """
    field, recipe = f"Body {body.name}.geometry", type(geometry).__name__
    try:
        made = validate.call(field, recipe, "build()", lambda: built(field, geometry))  # type: ignore[arg-type]
    except RequestError as error:
        raise (error if geometry == body.geometry else _of_refine(scene, body, error)) from error
    validate.kind_of(f"{field}.build()", made, Mesh, "return a warp_mca.Mesh")
    made.look_again()
    return made


def _of_refine(scene: Scene, body: Body, error: RequestError) -> RequestError:
    """The error, which names `refine` where it is of a value that the recipe has from this."""
    field = re.match(r"(\w+)\.(\w+) = ", str(error))
    if field is None or field[2] == "path":
        return error
    own = type(body.geometry).__name__ == field[1] and getattr(body.geometry, field[2], None)
    return error if str(error).startswith(f"{field[0]}{own!r}:") else bad_value("refine", scene.refine, str(error))


def _plain(geometry: object) -> bool:
    """Whether it is a recipe of the package whose mesh depends on its numbers alone, on no file and no other mesh."""
    if not is_dataclass(geometry) or isinstance(geometry, Mesh) or hasattr(geometry, "path"):
        return False
    if not type(geometry).__module__.startswith(_PACKAGE):
        return False
    return all(_is_number(getattr(geometry, field.name)) for field in fields(geometry))


def _is_number(value: object) -> bool:
    """Whether it is a number, a name or None, a tuple of such, or a recipe that depends on such alone."""
    if isinstance(value, tuple):
        return all(map(_is_number, value))
    return value is None or isinstance(value, int | float | str) or _plain(value)


def _key(geometry: object) -> Hashable:
    """What equal recipes share; a mesh, and a recipe that cannot be hashed, is like itself alone."""
    try:
        hash(geometry)
    except TypeError:
        return _Itself(geometry)
    return geometry


class _Itself:
    """Equal for one object alone, which it keeps: the id of one that is gone may be that of the next."""

    def __init__(self, item: object) -> None:
        self.item = item

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Itself) and other.item is self.item

    def __hash__(self) -> int:
        return id(self.item)


def _cut(scene: Scene, meshes: Mapping[str, Mesh]) -> dict[str, Mesh]:
    """The meshes, cut to the cell type of each body's element where that is possible."""
    return {body.name: cut_to(meshes[body.name], ELEMENTS[body.element].cell) for body in scene.bodies}


def _check_elements(scene: Scene, meshes: Mapping[str, Mesh]) -> None:
    """Refuses elements that compute no cell and were chosen, as other than the first of a type that meshes store.

    Raises:
        RequestError: there is one.
    """
    for element in ELEMENTS.values():
        asked = [body for body in scene.bodies if body.element == element.name]
        kind = CELL_TYPES[element.cell]
        stored = [meshes[body.name].cells[kind.stored_as] for body in asked if not body.rigid]
        usual = element is default_element(kind.name) and kind.stored_as == kind.name
        usual = usual or element.name == "hex8"  # which two_link names for bodies that a parameter makes rigid
        if asked and not usual and not any(among(cells, kind.name).any() for cells in stored):
            names = ", ".join(body.name for body in asked)
            cell = kind.field or (kind.name if kind.stored_as == kind.name else f"{kind.name}s")
            remedy = f"it computes {cell}, of which {names} {'has' if len(asked) == 1 else 'have'} none that deform"
            raise bad_value("element", element.name, f"{remedy}; leave it out")
