"""Sharing between vehicles: their tracks with covariances, their state, and their liveliness.

``payloads`` has the messages (JSON, schema 1), ``options`` the table [fleet], ``fleet_tracks`` makes messages of a
vehicle's tracks: these are PURE. ``bus`` is SHELL: a Zenoh session, the only module that imports zenoh.
"""
