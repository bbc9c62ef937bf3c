"""The sheet of a landing pad to print, at true size and with a ruler: ``check --pad FILE``.

``sheet.py`` says what is where in millimetres, ``pdf_pages.py`` and ``png_picture.py`` write it; all are PURE.
"""
