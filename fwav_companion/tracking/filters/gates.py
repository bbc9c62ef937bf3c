"""Gates on the normalised innovation squared (NIS) of a fix."""

from __future__ import annotations

from fwav_companion.tracking.filters.base import GATE as GATE
