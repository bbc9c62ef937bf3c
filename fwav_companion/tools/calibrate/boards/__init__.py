"""Printed boards: what they are (``spec``), and a finder for each kind."""
