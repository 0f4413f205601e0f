"""A run in the browser: what the page shows (pure), what it may do, and the server that feeds it."""

if not __name__.startswith("gridpeers."):
    raise ImportError(f"import gridpeers.{__name__}: this folder is linked there, and no module is loaded twice")
