"""What acts in the joints of chains, and weight."""
