"""Sends what a DeepStream pipeline finds to the companion: ``python detections_of_deepstream.py "PIPELINE"``.

On a Jetson, with pyds. The pipeline ends in an element named ``found`` behind nvinfer and nvtracker, as
``nvarguscamerasrc ! ... ! nvinfer ... ! nvtracker ... ! fakesink name=found``; [camera] stamp = "row0_start".
"""

import json
import socket
import sys

import gi
import pyds

gi.require_version("Gst", "1.0")
from gi.repository import Gst  # noqa: E402

COMPANION = ("127.0.0.1", 14601)
UNTRACKED = 0xFFFFFFFFFFFFFFFF


def metas(pointer, kind):
    """The elements of one of DeepStream's linked lists."""
    while pointer is not None:
        yield kind.cast(pointer.data)
        pointer = pointer.next


def found(frame):
    """Detections of a frame, in pixels of the stream muxer's output; its edges are half a pixel off our centres."""
    for thing in metas(frame.obj_meta_list, pyds.NvDsObjectMeta):
        left, top = thing.rect_params.left - 0.5, thing.rect_params.top - 0.5
        box = [left, top, left + thing.rect_params.width, top + thing.rect_params.height]
        place = {"u": (box[0] + box[2]) / 2, "v": (box[1] + box[3]) / 2, "box": box}
        score = {"score": thing.confidence} if thing.confidence >= 0.0 else {}
        tracked = {"id": thing.object_id} if thing.object_id != UNTRACKED else {}
        yield {**place, **score, **tracked, "label": thing.obj_label}


def frames(buffer, base_time_ns):
    """Frames as the companion takes them. A buffer's time counts from the pipeline's start, on CLOCK_MONOTONIC."""
    batch = pyds.gst_buffer_get_nvds_batch_meta(hash(buffer))
    for frame in metas(batch.frame_meta_list, pyds.NvDsFrameMeta):
        yield {
            "time_monotonic": (base_time_ns + frame.buf_pts) / 1e9,
            "frame": frame.frame_num,
            "size": [frame.source_frame_width, frame.source_frame_height],
            "detections": list(found(frame)),
        }


def send_all(description, companion):
    """Run the pipeline until it ends, and send each frame."""
    Gst.init(None)
    pipeline = Gst.parse_launch(description)

    def on_buffer(_pad, info):
        for frame in frames(info.get_buffer(), pipeline.get_base_time()):
            companion.sendto(json.dumps(frame).encode(), COMPANION)
        return Gst.PadProbeReturn.OK

    pipeline.get_by_name("found").get_static_pad("sink").add_probe(Gst.PadProbeType.BUFFER, on_buffer)
    pipeline.set_state(Gst.State.PLAYING)
    pipeline.get_bus().timed_pop_filtered(Gst.CLOCK_TIME_NONE, Gst.MessageType.ERROR | Gst.MessageType.EOS)


if __name__ == "__main__":
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as to_companion:
        send_all(sys.argv[1], to_companion)
