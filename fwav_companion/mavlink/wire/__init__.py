"""Bytes to messages and back: scanner, frames, definitions, codec, signing. Pure."""
