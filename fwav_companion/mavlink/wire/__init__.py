"""Converts bytes to MAVLink messages and back, byte for byte as pymavlink does. Pure.

``scanner`` finds the frames in the bytes of one link and gives each as a ``frames.RawFrame``: header read, payload
untouched, so that a relay need not decode it. ``frame_reader`` reads the frame that begins at a start byte, and
``flow_table`` remembers the known pairs of sender and message.

``codec`` decodes a frame to a message, and encodes fields to a frame. ``definitions`` is the table of all messages; it
alone imports pymavlink, and only for names, types and checksum seeds. ``payloads`` builds the pack and unpack functions
of one message from its definition. ``enums`` has the few constants that ``client`` needs. ``rate_messages`` reads a
station's request for message rates from its frame, and ``stream_groups`` lists the messages of ArduPilot's groups.

``signing`` signs our frames and verifies received ones. ``strip_signature`` removes signatures for a recording.
"""
