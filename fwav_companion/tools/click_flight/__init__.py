"""``demo --click``: a click on a rendered flight, in simulated time. SHELL."""
