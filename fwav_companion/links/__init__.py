"""SHELL: serial, UDP and TCP links behind one small protocol (``base.Link``).

``reconnect.make_link`` makes a link from a parsed URL (``url``). A link opens its connection, waits for its loss and
opens the next one; ``serial``, ``udp`` and ``tcp`` differ only in how they open. ``streams`` keeps frames whole.
"""
