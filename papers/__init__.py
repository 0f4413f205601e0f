"""Publications reproduced with gridpeers: the first users of the library, which import `gridpeers` alone."""
