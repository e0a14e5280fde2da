"""The tool's joint rates from its IMU, whose rates are those of the tool's body.

w_x = q_x' − sin q_y W, w_y = cos q_x q_y' + sin q_x cos q_y W, w_z = −sin q_x q_y' + cos q_x cos q_y W, with
the rate W of what it hangs from about the vertical.  On level ground the IMU's roll and pitch are the joints'
angles.
"""

import numpy as np


def joint_rates(
    roll: np.ndarray, pitch: np.ndarray, w_x: np.ndarray, w_y: np.ndarray, w_z: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(qd_tool_x, qd_tool_y) [rad/s] of the IMU's angles [rad] and rates [rad/s], each [n]."""
    sine, cosine = np.sin(roll), np.cos(roll)
    return w_x + np.tan(pitch) * (sine * w_y + cosine * w_z), cosine * w_y - sine * w_z
