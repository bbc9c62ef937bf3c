"""The pipeline: messages and frames in; messages, lines and notices out. Pure: the time is an argument.

``pipeline`` handles every event and wakes its components when they are due. ``camera_pipeline`` makes tracks from the
frames of a camera; ``frame_handlers`` passes these tracks to the publisher and the targets file. ``event_handlers``
applies an event of one room to the others, and reports readiness. ``pipeline_factory`` makes the components from a
configuration; ``components`` holds them. ``target_log`` counts and writes the targets file; ``output_buffer`` collects
the outputs. ``notices`` and ``self_calibration_notices`` word events for people.
``predicted_accuracy``, ``fix_agreement`` and ``frame_census`` assess the camera's data for the status.
"""
