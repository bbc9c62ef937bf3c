"""Gates on the normalised innovation squared (NIS) of a fix."""

from __future__ import annotations

GATE = 16.0
"""Gate on the NIS, 2 degrees of freedom: a true fix exceeds it once in 3000 times."""
