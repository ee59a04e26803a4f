"""A board on USB: its REPL, its drive, its rig file, images and edited modules."""
