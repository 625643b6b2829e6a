"""Owns the size of a patch, the elements of one block of threads, and how words of its corners are packed."""

PATCH = 128  # elements of a patch, and threads of its block
SLOTS = {"mixed": 384, "float64": 304}  # that a patch may have, as far as shared memory holds them
NOWHERE = PATCH  # behind the forces of all elements on their corners of one number, where shared memory holds a zero
# A word of an element's corners holds a slot from its first bit on, another up to its last, in the first two words half
# of the material's number between them.
SLOT_BITS, MATERIAL_BITS = 9, 14
SECOND_SLOT = SLOT_BITS + MATERIAL_BITS
