"""Control laws: the contract, and one published law a file. Pure."""
