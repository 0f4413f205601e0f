"""Parts of the paper that are many short runs of the islanding."""
