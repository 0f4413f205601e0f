"""What moves bytes and time: one Zenoh session, one queue, one loop; how processes start, end and print."""
