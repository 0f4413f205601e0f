"""How the plant's error depends on its step, against a solution of the same equations by scipy."""
