"""SHELL: the files that are read at the start, and the small ones that are rewritten ever again."""
