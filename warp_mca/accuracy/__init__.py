"""What a choice costs in error: figures of a run, variants of it, the trade-off between time and accuracy."""
