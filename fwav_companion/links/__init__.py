"""Ways in and out: serial, UDP and TCP behind one small protocol, each staying connected by itself."""
