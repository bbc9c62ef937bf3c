"""What is wrong with a set-up, and what to change. ``board`` probes, ``listening`` listens; the rest is pure judgement.

Reading order: ``finding``, ``evidence``, then one module a topic: ``ports``, ``autopilot``, ``clock``, ``camera``,
``upkeep``; ``examine`` joins them.
"""
