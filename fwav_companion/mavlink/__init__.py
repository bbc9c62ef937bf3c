"""Reads, routes and writes MAVLink messages. Pure: the time is passed in, and there are no sockets.

``wire`` converts bytes to messages and back. ``router`` decides for each frame of each link its destinations and its
rate. ``client`` implements our own components: heartbeats, TIMESYNC, commands, message rates. Router and client use
``wire`` and do not import each other.
"""
