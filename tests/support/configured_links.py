"""The links that a configuration of a test names, as TOML."""

from __future__ import annotations

AUTOPILOT = '[[link]]\nname = "autopilot"\nurl = "udpin://127.0.0.1:14540"\nrole = "autopilot"\n'
GROUND = '[[link]]\nname = "ground"\nurl = "udpout://127.0.0.1:14550"\nrole = "gcs"\n'
TABLET = '[[link]]\nname = "tablet"\nurl = "udpout://127.0.0.1:14551"\nrole = "gcs"\n'
