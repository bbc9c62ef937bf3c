"""The attitude at any instant, and how good the stream of attitudes is. Pure."""
