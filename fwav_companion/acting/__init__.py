"""Acts on the target that an operator selected in this flight: points at it, or sends it to be followed. PURE.

Nothing is sent unless [act] asks for it, an operator selected the target while the vehicle flew, and nothing has ended
that since. Nothing that is sent arms, changes a mode or a parameter, or commands a movement; only ``roi`` may turn the
vehicle's nose.

``acting`` is the interface. ``permission`` decides whether the service may act, and why no longer. ``gimbal_manager``
takes and returns the control of a gimbal, ``pointing`` computes where it has to look, and ``gimbal_watch`` notices that
it does not follow. ``roi`` and ``follow`` send the target to the autopilot.
"""
