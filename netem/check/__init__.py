"""Does a link do what it was told? Configured against realised, for reports: here numpy and scipy are fine."""
