"""Moves: files of several formats, checks before playing, playing and shooting."""
