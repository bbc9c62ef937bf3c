"""Self-calibration: the camera's delay, its mount and the height, from targets that are seen again and again.

Reading order: ``course``, ``rays``, ``turning``, ``joint``, ``fit``, ``search``, ``passes``; ``drift``, ``answer``,
``loosening``, ``verdict``, ``report``; ``comparison``; ``sights``, ``mistakes``; ``lessons``, ``workshop``,
``calibrator``.
"""
