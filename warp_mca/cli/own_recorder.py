"""Owns the option `--recorder`: a recorder of the user's own, by its module and its class."""

from __future__ import annotations

import inspect
from ast import literal_eval
from typing import TYPE_CHECKING, Any

from warp_mca.base.errors import bad_value
from warp_mca.base.outside import import_named
from warp_mca.base.validate import call

if TYPE_CHECKING:
    from warp_mca.recorders import Cadence, Recorder

FIELD = "--recorder"
FORM = "write it as MODULE:NAME or MODULE:NAME,KEY=VALUE"


def own_recorder(text: str, cadence: Cadence) -> Recorder:
    """The recorder that `MODULE:NAME[,KEY=VALUE…]` means, or `NAME` alone where a module has registered it.

    Its class is called with the values by their keys, numbers and True or False as such, and with `cadence` where it
    takes that.

    Raises:
        RequestError: there is no such class, it is no recorder, or it cannot be made.
    """
    from warp_mca.recorders import RECORDERS
    from warp_mca.registration import TABLES

    place, *settings = text.split(",")
    module, colon, name = place.partition(":")
    kind = getattr(import_named(FIELD, module), name, None) if colon and name else RECORDERS.get(place)
    if kind is None and colon and name:
        raise bad_value(FIELD, text, f"the module {module} has no {name}")
    if kind is None:
        known = f", or give a registered one: {', '.join(RECORDERS)}" if RECORDERS else ""
        raise bad_value(FIELD, text, FORM + known)
    if not TABLES["recorder"].takes(kind):
        raise bad_value(FIELD, text, f"name {TABLES['recorder'].remedy}")
    options: dict[str, Any] = {}
    for setting in settings:
        key, equals, value = setting.partition("=")
        if not (key.isidentifier() and equals) or key in options:
            raise bad_value(FIELD, text, f"{FORM}, each KEY once")
        options[key] = _value(value)
    if "cadence" in inspect.signature(kind).parameters:
        options.setdefault("cadence", cadence)
    return call(FIELD, text, f"{kind.__name__}()", kind, **options)


def _value(text: str) -> object:
    """A number, True, False or None where the text is one; else the text."""
    try:
        value = literal_eval(text)
    except (ValueError, SyntaxError):
        return text
    return value if value is None or isinstance(value, int | float) else text
