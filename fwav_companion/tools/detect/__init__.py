"""SHELL: the configured detector over recorded pictures.

``recorded_pictures`` reads folders, files and videos with their times; ``photo_metadata`` reads EXIF (Pillow) and the
XMP of drone makers.
"""
