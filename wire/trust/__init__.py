"""Certificates and access: who a process is, and what it may say to whom."""
