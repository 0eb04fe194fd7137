"""Camera calibration: intrinsics, lens distortion and mounting; and what is learnt of the camera on the way."""
