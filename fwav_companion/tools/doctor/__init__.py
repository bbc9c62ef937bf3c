"""What is wrong with a set-up, and what to change. ``board`` probes (with ``serial_ports``, ``holders``, ``tree``),
``listening`` listens; the rest is pure judgement.

Reading order: ``finding``, ``evidence``, then one module a topic: ``ports``, ``autopilot``, ``clock``, ``camera`` (with
``refusals``), ``upkeep``; ``examine`` joins them.
"""
