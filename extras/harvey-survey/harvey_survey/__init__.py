"""What is measured before a robot drives: its camera, by pictures of a board (``harvey calibrate``)."""
