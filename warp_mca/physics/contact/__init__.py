"""Contact: springs between slave nodes and the faces of masters."""
