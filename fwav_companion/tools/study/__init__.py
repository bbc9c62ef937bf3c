"""``study``: how accurate will it be, what limits it, and would other settings have been better.

Reading order: ``causes``, ``keys``, ``study_plan`` (what is asked); ``flight_draw`` (one flight from the priors),
``mock_process`` and ``study_flight`` (flown, replayed, a record); ``flight_record``, ``record_file`` (the Parquet
file); ``cluster``, ``engine`` (many flights on many workers); ``distributions``, ``conclusions``, ``answer_text``,
``study_charts``, ``study_page`` (the answer); ``recorded_flights``, ``paired_settings``, ``settings_answer`` (the same
for a team's own recordings); ``paper_preset``.
"""
