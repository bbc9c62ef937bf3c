"""SHELL: the demonstration: mock autopilot and rendered camera in processes of their own, the service as it flies."""
