"""Many runs: batches and sweeps."""
