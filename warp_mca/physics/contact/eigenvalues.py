"""Owns what contact springs add to the largest eigenvalue at their nodes, from which the stable step follows."""

from __future__ import annotations

import numpy as np

from warp_mca.base.arrays import Array, Index
from warp_mca.physics.contact.stiffness import node_mean
from warp_mca.system.contact import ContactPass, Faces


def contact_eigenvalues(item: ContactPass, slave: Faces, master: Faces | None, mass: Array) -> tuple[Index, Array]:
    """What a pass can add to the largest eigenvalue at its nodes [1/s^2]: row sums of M^-1 K of its springs.

    A slave's row sums to k (1 + sum N) / m = 2 k / m, or k / m against a plane, and to more where sides of the master
    press it at once; a master node's to as much, times the number of slave nodes that share its area. k is the greatest
    stiffness that the spring can have: that of the stiffest master face for a slave node, that of the stiffest face
    around it for a master node; both times what the contact law adds as it stiffens.
    """
    if master is None:
        return item.slave, item.stiffening * item.stiffness / mass[item.slave]
    at_once = item.stiffening * item.at_once
    slave_k = at_once * np.minimum(item.stiffness, item.face_stiffness.max())
    around = np.maximum.reduceat(item.face_stiffness[item.face_of_node], item.face_offset[:-1])
    master_k = at_once * np.minimum(around, item.stiffness.max())
    slave_area = 4.0 * np.median(node_mean(item.slave, slave, slave.area / 4.0))
    shared = np.maximum(1.0, 4.0 * node_mean(item.master, master, master.area / 4.0) / slave_area)
    nodes = np.concatenate([item.slave, item.master])
    return nodes, np.concatenate([2.0 * slave_k / mass[item.slave], 2.0 * master_k * shared / mass[item.master]])
