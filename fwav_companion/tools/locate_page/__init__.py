"""The page of `locate --http`: pictures beside a map, clicks that are saved at once.

`page_server.py` answers the page, `board.py` keeps the clicks and asks the session, `shelf.py` has the images.
"""
