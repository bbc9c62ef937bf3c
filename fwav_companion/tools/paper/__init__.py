"""PURE: repeats the paper's experiment from its own constants, with numpy, and matplotlib for figures.

The daemon never loads this package.
"""
