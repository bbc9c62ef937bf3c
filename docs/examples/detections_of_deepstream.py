"""Sends what a DeepStream pipeline finds to the companion: ``python detections_of_deepstream.py "PIPELINE"``.

On a Jetson, with pyds. The pipeline ends in an element named ``found`` behind nvinfer and nvtracker, as
``nvarguscamerasrc ! ... ! nvinfer ... ! nvtracker ... ! fakesink name=found``; [camera] stamp = "row0_start".
"""

import json
import socket
import sys

import pyds
from gi.repository import Gst

COMPANION, UNTRACKED = ("127.0.0.1", 14601), 0xFFFFFFFFFFFFFFFF


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
        named = {"label": thing.obj_label, "score": max(0.0, thing.confidence), "box": box}
        tracked = {} if thing.object_id == UNTRACKED else {"id": thing.object_id}
        yield {"u": (box[0] + box[2]) / 2, "v": (box[1] + box[3]) / 2, **named, **tracked}


def on_buffer(_pad, info, base_time_ns, companion):
    """Send the frames of a buffer. Its time counts from the pipeline's start, on CLOCK_MONOTONIC."""
    for each in metas(pyds.gst_buffer_get_nvds_batch_meta(hash(info.get_buffer())).frame_meta_list, pyds.NvDsFrameMeta):
        sent = {"time_monotonic": (base_time_ns() + each.buf_pts) / 1e9, "detections": list(found(each))}
        sent["size"] = [each.source_frame_width, each.source_frame_height]
        companion.sendto(json.dumps(sent).encode(), COMPANION)
    return Gst.PadProbeReturn.OK


if __name__ == "__main__":
    Gst.init(None)
    pipeline, sender = Gst.parse_launch(sys.argv[1]), socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sink = pipeline.get_by_name("found").get_static_pad("sink")
    sink.add_probe(Gst.PadProbeType.BUFFER, on_buffer, pipeline.get_base_time, sender)
    pipeline.set_state(Gst.State.PLAYING)
    pipeline.get_bus().timed_pop_filtered(Gst.CLOCK_TIME_NONE, Gst.MessageType.ERROR | Gst.MessageType.EOS)
