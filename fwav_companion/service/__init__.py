"""SHELL: the daemon, what it is made of, and what it remembers from one run to the next."""
