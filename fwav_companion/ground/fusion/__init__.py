"""Fusion of the targets of many vehicles to one picture. PURE, in numpy.

``reported_tracks`` are the vehicles' tracks in one local plane. ``association`` decides which tracks are one target,
``registration`` estimates the shift of a vehicle's pattern of targets, ``bias_solution`` solves for all targets and
for each vehicle's own biases at once, ``consistency`` names a vehicle that is wrong. ``fleet_fusion`` joins them.

The fusion keeps no estimate between two steps. A track already is the average of all sightings of its vehicle, so
every step solves from the present tracks alone, and counts no sighting twice. Only the association is kept.
"""
