"""The paper's experiment, repeated from its own constants; numpy, matplotlib for figures. Never the daemon's."""
