"""What this component owes the network and asks of the autopilot: identity, TIMESYNC, commands, rates. Pure."""
