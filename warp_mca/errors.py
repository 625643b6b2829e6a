"""Owns the two ways in which a request or a run can fail, and the exit status of each."""

from __future__ import annotations


class McaError(Exception):
    """Base of every error that warp_mca raises on purpose."""

    exit_status = 1


class RequestError(McaError, ValueError):
    """A request that cannot be carried out as written: bad value, name, mesh or file."""

    exit_status = 2


class GuardError(McaError, RuntimeError):
    """A run that broke one of its guards, so that its numbers must not be trusted."""

    exit_status = 1


def bad_value(field: str, value: object, remedy: str) -> RequestError:
    """One sentence that names the field, the value it had and what to do about it."""
    return RequestError(f"{field} = {value!r}: {remedy}")
