"""Singhal, Vu, Du: its tables, claims and figures, and our experiments on its microgrid.

"Consensus Control for Coordinating Grid-Forming and Grid-Following Inverters in Microgrids", IEEE Transactions on Smart
Grid, 2022.
"""
