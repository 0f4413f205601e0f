"""The command `gridpeers`: `app` is its entry, `commands` holds its commands, the rest is what they have in common."""
