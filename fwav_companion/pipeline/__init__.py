"""From messages and frames to tracks and messages: the rooms, joined. PURE: it is handed the time."""
