"""SHELL: the demonstration: a mock autopilot and a rendered camera in processes of their own, and the service as ever."""
