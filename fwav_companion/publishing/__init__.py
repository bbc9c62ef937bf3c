"""Tracks to messages: for the autopilot that lands on them, the ground station that shows them, and maps. Pure."""
