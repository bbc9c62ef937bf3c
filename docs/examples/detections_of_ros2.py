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
    across, along = detection.bbox.size_x / 2, detection.bbox.size_y / 2
    named = {} if best is None else {"label": best.class_id, "score": min(1.0, best.score)}
    tracked = {"id": int(detection.id)} if detection.id.isdigit() else {}
    return {"u": u, "v": v, "box": [u - across, v - along, u + across, v + along], **named, **tracked}


def frame_of(message, size):
    """The frame as the companion takes it; one without detections counts too."""
    time_unix = message.header.stamp.sec + message.header.stamp.nanosec / 1e9
    return {"time_unix": time_unix, "size": size, "detections": [found(each) for each in message.detections]}


if __name__ == "__main__":
    rclpy.init()
    node, companion = Node("detections_to_companion"), socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    topic, size = sys.argv[1], [int(sys.argv[2]), int(sys.argv[3])]

    def send(message):
        """Send one message on."""
        companion.sendto(json.dumps(frame_of(message, size)).encode(), COMPANION)

    node.create_subscription(Detection2DArray, topic, send, qos_profile_sensor_data)
    rclpy.spin(node)
