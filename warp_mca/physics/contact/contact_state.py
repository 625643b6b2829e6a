"""Owns the state of a contact pass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import warp as wp


@dataclass(eq=False)
class ContactState:
    """State of a contact pass; lists are those of the latest search, and empty on a rigid plane.

    Attributes:
        spring: of each slave node and side, those of slave 0 first; `kernels.contact.spring.Spring` lists its arrays.
        count: faces in the list of each slave and side [-], shape (spring_count,), int32.
        candidate: these faces [-], shape (spring_count, LIST_LENGTH), int32.
        face_count: slaves in the list of each master face [-], shape (face_count,), int32.
        face_slave: these slaves, sorted [-], shape (face_count, room), int32.
        u_search: displacement of slaves and masters at the search [m], shape (node_count,), vec3d.
        slot: bodies for which each slave node has springs in a general contact, or -1 [-], shape (slave_count,
            slot_count), int32; empty elsewhere.
    """

    spring: Any
    count: wp.array
    candidate: wp.array
    face_count: wp.array
    face_slave: wp.array
    u_search: wp.array
    slot: wp.array
