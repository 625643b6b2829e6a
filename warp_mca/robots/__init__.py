"""Owns machines in three dimensions from the files that roboticists have, read and swung by MuJoCo."""
