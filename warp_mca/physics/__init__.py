"""Things that act on nodes, a room for each: its arrays, its part of the state, its stages on the device."""
