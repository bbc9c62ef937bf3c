"""SHELL: the configured detector over recorded pictures.

``recorded_pictures`` reads folders, files and videos with their times, and the poses of pictures by their tags.
"""
