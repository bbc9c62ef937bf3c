"""An RTSP server of GStreamer's whose pictures have their number in them. Run by the system's Python.

``rtsp_server.py PORT send|capture``: prints the port when it listens, then ``NUMBER MONOTONIC_S`` of each picture as it
is pushed. ``send``: reports carry the time of sending (GStreamer's default), ``capture``: that of the picture.
"""

import sys
import time

import gi

gi.require_version("Gst", "1.0")
gi.require_version("GstRtspServer", "1.0")
from gi.repository import GLib, Gst, GstRtspServer  # noqa: E402

WIDTH, HEIGHT, FPS, BITS = 320, 240, 30, 16
LAUNCH = (
    f"( appsrc name=src is-live=true do-timestamp=true format=time "
    f"caps=video/x-raw,format=GRAY8,width={WIDTH},height={HEIGHT},framerate={FPS}/1 ! videoconvert ! "
    "video/x-raw,format=I420 ! x264enc tune=zerolatency speed-preset=ultrafast key-int-max=15 bitrate=3000 ! "
    "rtph264pay name=pay0 pt=96 config-interval=1 )"
)


class Camera:
    def __init__(self, source):
        self.source, self.number = source, 0
        GLib.timeout_add(1000 // FPS, self.push)

    def push(self):
        bar = WIDTH // BITS
        row = b"".join(bytes([235 if self.number >> bit & 1 else 16]) * bar for bit in range(BITS))
        now = time.monotonic()
        if self.source.emit("push-buffer", Gst.Buffer.new_wrapped(row * HEIGHT)) != Gst.FlowReturn.OK:
            return False
        print(self.number, now, flush=True)
        self.number += 1
        return True


def main():
    port, stamps = sys.argv[1:]
    Gst.init(None)
    server = GstRtspServer.RTSPServer.new()
    server.set_service(port)
    factory = GstRtspServer.RTSPMediaFactory.new()
    factory.set_launch(LAUNCH)

    def prepared(media):
        pipeline = media.get_element().get_parent()
        while pipeline.get_parent() is not None:
            pipeline = pipeline.get_parent()
        found = pipeline.iterate_all_by_element_factory_name("rtpbin")
        _, rtpbin = found.next()
        rtpbin.set_property("rtcp-sync-send-time", stamps == "send")

    def configure(_factory, media):
        media.connect("prepared", prepared)
        main.camera = Camera(media.get_element().get_by_name_recurse_up("src"))

    factory.connect("media-configure", configure)
    server.get_mount_points().add_factory("/main", factory)
    server.attach(None)
    print("listens", server.get_bound_port(), flush=True)
    GLib.MainLoop().run()


main()
