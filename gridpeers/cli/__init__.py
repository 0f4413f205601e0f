"""The command `gridpeers`: `app` is all of it, `commands` holds its commands, the rest is what they have in common."""
