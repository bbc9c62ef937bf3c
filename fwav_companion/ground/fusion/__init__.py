"""Targets of many vehicles to one picture. PURE, in numpy.

``reported_tracks`` are what vehicles say, in one local plane. ``association`` decides which tracks are one target,
``registration`` finds how far a vehicle's pattern of targets is shifted, ``bias_solution`` solves for all targets and
for each vehicle's own biases at once, ``consistency`` names a vehicle that is wrong. ``fleet_fusion`` joins them.

The fusion keeps no estimate between two steps: a track already is the average of all that its vehicle has seen, so
every step solves from the present tracks alone, and nothing is counted twice. It keeps which tracks are one target.
"""
