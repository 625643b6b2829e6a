"""What binds nodes: joints, driven axes, couplings of clusters."""
