"""`install`: the service on a board.

`observing.py` reads the system, `plan.py` decides the steps (PURE), `execution.py` does them.
"""
