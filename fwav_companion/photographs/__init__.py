"""A picture's tags to its pose and lens, with datum and errors, or the reason why it has none. PURE.

``makers`` is the table of the makers' layouts; ``pose_from_tags`` and ``lens_from_tags`` apply it. ``files`` opens
pictures (SHELL).
"""
