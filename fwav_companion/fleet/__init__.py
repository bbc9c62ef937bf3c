"""What vehicles share with one another: their tracks with covariances, their state, and that they live.

``payloads`` are the messages (JSON, schema 1), ``options`` the table [fleet], ``fleet_tracks`` makes messages of a
vehicle's tracks: these are PURE. ``bus`` is SHELL: a Zenoh session, the only module that imports zenoh.
"""
