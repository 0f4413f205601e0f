"""Words for a package with a library of its own that is installed and does not load."""

from __future__ import annotations

DISTRIBUTIONS = {"dss": "dss-python dss-python-backend", "py_dss_interface": "py-dss-interface"}
"""What pip calls a package, where it has another name there."""


def damaged(module: str, reason: str, user: str) -> str:
    """Return one line on a package that is installed, and cannot be imported for a reason.

    Examples
    --------
    >>> damaged("dss", "OSError: no libdss.so", "the import")
    'dss is installed, but cannot be imported (OSError: no libdss.so); the import needs it: pip install \
--force-reinstall dss-python dss-python-backend'
    """
    again = f"pip install --force-reinstall {DISTRIBUTIONS.get(module, module)}"
    return f"{module} is installed, but cannot be imported ({' '.join(reason.split())}); {user} needs it: {again}"
