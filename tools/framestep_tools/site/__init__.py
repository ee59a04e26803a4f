"""Static pages: framestep in a browser tab, on an emulated board."""
