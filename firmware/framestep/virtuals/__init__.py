"""Virtual axes: the camera's place and angles instead of motors."""
