"""Makes messages from tracks: for the autopilot that lands on them, for ground stations, and for maps. PURE.

``publisher`` is the interface: it takes the tracks of every processed frame. ``landing`` makes LANDING_TARGET;
``camera_component`` answers as the camera, with ``camera_information`` and ``tracking_status`` for its messages,
``selection`` for the selected target and ``intervals`` for message rates. ``ground_messages`` and ``cot`` serve other
displays. ``announcer`` makes notices of targets and encodes notices as STATUSTEXT; ``readiness`` reports whether the
vehicle can localize. ``target_report`` gives the others a track's position on the earth at the present time.
"""
