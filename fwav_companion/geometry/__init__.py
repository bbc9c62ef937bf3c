"""Frames, rotations, the earth and clocks as types. Pure; scalar ``math`` only: the job is one detection at a time.

Conventions (the whole list is in ARCHITECTURE.md): body FRD, camera RDF (x right, y down, z forward), world local NED;
quaternions are (w, x, y, z), Hamilton, and ``b_from_a`` maps coordinates in frame a to coordinates in frame b.
"""
