"""A ROS 2 node that passes vision_msgs/Detection2DArray on: ``python detections_of_ros2.py /detections 640 480``.

The header's stamp must be that of the picture, as camera drivers set it and detectors should copy it, and the node's
clock that of the system (use_sim_time false). The numbers are the picture's size.
"""

import json
import socket
import sys

import rclpy
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from vision_msgs.msg import Detection2DArray

COMPANION = ("127.0.0.1", 14601)


def found(detection):
    """One detection, by its likeliest hypothesis. Boxes count edges of pixels, half a pixel from our centres."""
    best = max((result.hypothesis for result in detection.results), key=lambda each: each.score, default=None)
    u, v = detection.bbox.center.position.x - 0.5, detection.bbox.center.position.y - 0.5
    half_width, half_height = detection.bbox.size_x / 2, detection.bbox.size_y / 2
    named = {} if best is None else {"label": best.class_id, "score": min(1.0, best.score)}
    tracked = {"id": int(detection.id)} if detection.id.isdigit() else {}
    return {
        "u": u,
        "v": v,
        "box": [u - half_width, v - half_height, u + half_width, v + half_height],
        **named,
        **tracked,
    }


def frame_of(message, size):
    """The frame as the companion takes it; one without detections counts too."""
    stamp = message.header.stamp
    return {
        "time_unix": stamp.sec + stamp.nanosec / 1e9,
        "size": size,
        "detections": [found(each) for each in message.detections],
    }


class Sender(Node):
    """Sends each message on."""

    def __init__(self, topic, size):
        super().__init__("detections_to_companion")
        self._companion = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._size = size
        self.create_subscription(Detection2DArray, topic, self.on_detections, qos_profile_sensor_data)

    def on_detections(self, message):
        """Send one message on."""
        self._companion.sendto(json.dumps(frame_of(message, self._size)).encode(), COMPANION)


if __name__ == "__main__":
    rclpy.init()
    rclpy.spin(Sender(sys.argv[1], [int(sys.argv[2]), int(sys.argv[3])]))
