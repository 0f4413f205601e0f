"""A run in the browser: what the page shows (pure), what it may do, and the server that feeds it."""
