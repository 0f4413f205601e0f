"""What users plug in: registries, references, the shape of a plug-in, what foreign code may raise."""
