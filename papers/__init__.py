"""Publications reproduced with gridpeers: the first users of the library, which import `gridpeers` alone."""

if not __name__.startswith("gridpeers."):
    raise ImportError(f"import gridpeers.{__name__}: this folder is linked there, and no module is loaded twice")
