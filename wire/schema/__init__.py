"""Fields of a table of a file, or of a plug-in with parameters, and the one reader of both. Pure."""
