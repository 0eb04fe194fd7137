"""What is learnt of the camera on the way: its state, whether lens or model err."""

from knowledge_sources.methods.calibration.camera_rivals import Opened, SeenLines, explain, open_rivals
from knowledge_sources.methods.calibration.camera_state import (
    LEAST_SIGMA_CENTRE_PX, LEAST_SIGMA_FOCAL, LEAST_SIGMA_M, LEAST_SIGMA_RAD, MAX_COUNTED, MIN_MOVE_M, MIN_TURN_RAD,
    RIGID_DISTANCE_M, SIGMA_CENTRE_PX, SIGMA_FOCAL, SIGMA_HEIGHT_M, SIGMA_ROLL_RAD, SIGMA_TILT_RAD, SIGMA_YAW_RAD,
    add_yaw, compute_camera_covariance, compute_knocked_covariance, compute_scale_sigma, has_counted, is_camera_known,
    learn, loosen, to_tuples, widen,
)
from knowledge_sources.methods.calibration.model_evidence import find_model_evidence, is_model_doubted, is_strange

__all__ = [
    "LEAST_SIGMA_CENTRE_PX", "LEAST_SIGMA_FOCAL", "LEAST_SIGMA_M", "LEAST_SIGMA_RAD", "MAX_COUNTED", "MIN_MOVE_M",
    "MIN_TURN_RAD", "RIGID_DISTANCE_M", "SIGMA_CENTRE_PX", "SIGMA_FOCAL", "SIGMA_HEIGHT_M", "SIGMA_ROLL_RAD",
    "SIGMA_TILT_RAD", "SIGMA_YAW_RAD", "Opened", "SeenLines", "add_yaw", "compute_camera_covariance",
    "compute_knocked_covariance", "compute_scale_sigma", "explain", "find_model_evidence", "has_counted",
    "is_camera_known", "is_model_doubted", "is_strange", "learn", "loosen", "open_rivals", "to_tuples", "widen",
]
