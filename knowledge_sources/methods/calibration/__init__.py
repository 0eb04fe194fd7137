"""Camera calibration: intrinsics, lens distortion and mounting; and what is learnt of the camera on the way."""

from knowledge_sources.methods.calibration.calibration_picture import draw_calibration
from knowledge_sources.methods.calibration.camera_state import (
    RIGID_DISTANCE_M, add_yaw, compute_camera_covariance, compute_knocked_covariance, has_counted, is_camera_known,
    learn, loosen, to_tuples, widen,
)
from knowledge_sources.methods.calibration.intrinsics import (
    BoardView, Calibration, PARAMETERS, Pattern, calibrate, find_board,
)
from knowledge_sources.methods.calibration.mounting import Mounting, estimate_mounting

__all__ = [
    "PARAMETERS", "RIGID_DISTANCE_M", "BoardView", "Calibration", "Mounting", "Pattern", "add_yaw", "calibrate",
    "compute_camera_covariance", "compute_knocked_covariance", "draw_calibration", "estimate_mounting",
    "find_board", "has_counted", "is_camera_known", "learn", "loosen", "to_tuples", "widen",
]
