"""Pictures of the bodies of a run: drawn here or by pyvista."""
