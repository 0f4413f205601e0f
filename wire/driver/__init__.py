"""The driver moves bytes and time: one Zenoh session, one queue, one loop; start, end and output of a process."""
