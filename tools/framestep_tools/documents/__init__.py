"""Generated pages, tables and pictures of the documents."""
