"""Commands that `run` never loads: each folder is one tool."""
