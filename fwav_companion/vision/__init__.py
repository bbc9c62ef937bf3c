"""Where pixels come from: detections of other processes, with the form they have on the wire and in recordings."""
