"""The tracker by filters of single targets: the paper's low-pass, or a filter of one's own. Pure, without numpy.

Reading order: ``base`` (the protocol of a filter); ``fix_sample``, ``averages``, ``position_error``, ``lowpass``;
``filter_frame``, ``alternation``, ``filter_tracker``.
"""
