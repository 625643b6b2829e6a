"""Owns the size of a patch, the elements of one block of threads, and how words of its corners are packed."""

PATCH = 128  # elements of a patch, and threads of its block
SLOTS = {"mixed": 384, "float64": 304}  # slots of a patch at most, as shared memory allows
NOWHERE = PATCH  # the entry behind the forces of all elements at one corner, which is a zero in shared memory
# A word holds the slots of two corners, in its lowest and its highest bits; between them, the first two words hold one
# half each of the material's number.
SLOT_BITS, MATERIAL_BITS = 9, 14
SECOND_SLOT = SLOT_BITS + MATERIAL_BITS
