"""The published study, run again: its figures, its claims beside ours, and the page that shows both."""
