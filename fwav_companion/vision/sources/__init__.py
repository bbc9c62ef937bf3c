"""Where pictures come from: one file a kind, each behind :class:`fwav_companion.vision.images.Source`."""
