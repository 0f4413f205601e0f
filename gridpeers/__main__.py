"""`python -m gridpeers` is the command `gridpeers`."""

from gridpeers.cli.app import main

main()
