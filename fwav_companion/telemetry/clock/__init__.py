"""The autopilot's clock in terms of the host's. Pure."""
