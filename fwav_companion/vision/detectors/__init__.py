"""What looks at pictures: one file a kind, each behind :class:`fwav_companion.vision.images.Detector`."""
