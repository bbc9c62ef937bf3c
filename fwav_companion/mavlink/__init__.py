"""Reads, routes and writes MAVLink messages. Pure: the time is passed in, and there are no sockets.

``wire`` turns bytes into messages and back. ``router`` decides for each frame of each link where it goes, and how
often. ``client`` is the behaviour of our own components: heartbeats, TIMESYNC, commands, message rates. Router and
client use ``wire`` and do not import each other.
"""
