"""One run: started, and its folder as tables and figures."""
