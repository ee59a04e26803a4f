"""Pages, tables and pictures of the documents that are made from data."""
