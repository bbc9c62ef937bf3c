"""`demo --photographs`: pictures with poses in their tags, drawn by the mock, located and compared with the truth."""
