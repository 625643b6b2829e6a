"""Guards, warnings and advice: what a run says of itself."""
