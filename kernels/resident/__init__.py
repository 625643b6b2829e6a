"""Kernels that take many steps in one launch, for models that a GPU holds at once."""
