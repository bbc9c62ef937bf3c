"""Vectors, rotations, WGS84 and clocks as types. Pure, and scalar ``math`` only: the work is one detection at a time.

Conventions (ARCHITECTURE.md has the whole list): body FRD, camera RDF (x right, y down, z forward), world local NED.
Quaternions are (w, x, y, z), Hamilton; ``b_from_a`` maps coordinates in frame a to coordinates in frame b.
"""
