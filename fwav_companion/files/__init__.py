"""SHELL: opens and writes files for the pure rooms: read at the start, reported at the end, or rewritten ever again."""
