"""Where each frame goes: routing, peers, signing policy, rate limits. Pure."""
