"""The flight recorder: one file `run.mcap` for each case, with all that went into the cores and came out of them.

`record_writer` writes it while the case runs; `record_reader` opens it, whole or cut off.
docs/reference/files-and-export.md describes the file.
"""
