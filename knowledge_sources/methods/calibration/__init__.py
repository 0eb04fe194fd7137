"""Camera calibration: intrinsics, lens distortion and mounting."""
