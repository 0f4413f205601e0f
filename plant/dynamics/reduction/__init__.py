"""The network as seen from loads and terminals, in dense and in sparse form."""
