"""A camera component, requests to it, and its messages over some seconds."""

from fwav_companion.publishing.options import PublishOptions
from fwav_companion.types import Command

MS = 10**6
SIZE = (640, 480)
OPTIONS = PublishOptions(
    image_size=SIZE, named_values=False, statustext=False, version=(1, 2, 3), video_uri="rtsp://10.0.0.2/live"
)
IMAGE, GEO = "CAMERA_TRACKING_IMAGE_STATUS", "CAMERA_TRACKING_GEO_STATUS"


def command(number, *params, sender=(255, 190), component=100):
    params = (*params, *(0.0,) * (7 - len(params)))
    return Command(
        number=number, params=params, system=sender[0], component=sender[1], link="ground", to_component=component
    )


def run(publisher, world, seconds, tracks=(), start=None, step_ms=5, **situation):
    """Messages by name over some seconds, with a frame of these tracks every 50 ms."""
    start = start if start is not None else world.NOW
    sent = []
    for tick in range(round(seconds * 1000 / step_ms)):
        now = start + tick * step_ms * MS
        moment = world.situation(now=now, **situation)
        if tick * step_ms % 50 == 0:
            sent += publisher.on_tracks(tuple(world.track(n, at=now) for n in tracks), moment)
        while publisher.wake_at is not None and publisher.wake_at <= now:
            sent += publisher.on_wake(now, moment)
    return sent


def named(sent, name):
    return [one for one in sent if one.name == name]
