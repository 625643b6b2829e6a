"""Owns the errors: a request that cannot be carried out, a run stopped by a guard; and the exit status of each."""

from __future__ import annotations

LONGEST = 400  # characters of a value in a message


class McaError(Exception):
    """Base of every error that warp_mca raises on purpose."""

    exit_status = 1


class RequestError(McaError, ValueError):
    """A request that cannot be carried out as written: bad value, name, mesh or file."""

    exit_status = 2


class GuardError(McaError, RuntimeError):
    """A run that broke one of its guards, so that its numbers must not be trusted."""

    exit_status = 1


class CriterionError(McaError):
    """A run that is sound, of which a criterion does not hold."""

    exit_status = 3


def bad_value(field: str, value: object, remedy: str) -> RequestError:
    """One sentence that names the field, the value it had and what to do about it."""
    return RequestError(f"{field} = {_shown(value)}: {remedy}")


def _shown(value: object) -> str:
    """The value as a message shows it: on one line, shortened if it is long."""
    try:
        text = repr(value)
    except Exception:  # Python refuses to print integers of many digits; a user's own class may fail too
        text = f"({type(value).__name__})"
    text = " ".join(text.split()) if "\n" in text else text
    return text if len(text) <= LONGEST else f"{text[:LONGEST]} …"
