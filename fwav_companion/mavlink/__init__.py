"""Bytes to messages and back, and what a citizen of a MAVLink network owes it. Pure: no sockets, no clock."""
