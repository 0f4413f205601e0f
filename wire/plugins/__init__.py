"""Plug-ins of users: registries, references, required shapes, errors of foreign code."""
