"""What a table of a file, or a plug-in with parameters, declares of its fields, and the one reader of both. Pure."""
