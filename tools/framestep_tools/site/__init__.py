"""Static pages: the documents, and framestep on an emulated board in a browser tab."""
