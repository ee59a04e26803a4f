"""Virtual axes: the camera's position and angles instead of motors."""
