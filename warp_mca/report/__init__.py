"""Reports: plots and tables made from a finished run."""
