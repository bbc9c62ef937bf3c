"""SHELL: `locate`: from a pixel in a picture to a place on the map.

``estimate`` has the mathematics (PURE): cameras, sights and a surface in, places with covariance out. ``heights`` puts
pictures and ground on one vertical scale. ``photographs`` reads pictures into cameras (SHELL), ``answers`` turns
places into what is printed and exported.
"""
