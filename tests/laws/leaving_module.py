"""A module that ends Python while it is imported: a script without the guard of its main part."""

import sys

sys.exit(3)
