"""Pictures of one target with poses of their own, as the files of a replay, by a pinhole camera and ECEF in numpy."""

import json

import numpy as np

LENS = """
image_width: 4000
image_height: 3000
distortion_model: plumb_bob
camera_matrix: {rows: 3, cols: 3, data: [3000.0, 0, 2000.0, 0, 3000.0, 1500.0, 0, 0, 1]}
distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}
"""
FIXED = '[camera]\ncalibration = "camera.yaml"\nreadout_s = 0.0\n[ground]\nmodel = "fixed"\nheight_m = 60.0\n'
TARGET = (48.137, 11.575, 519.0)
BEGUN_S = 1_790_000_000.0
COLUMNS = "frame,time_unix,lat,lon,alt_amsl,roll_deg,pitch_deg,yaw_deg"


def ecef(lat_deg, lon_deg, height_m):
    lat, lon = np.radians([lat_deg, lon_deg])
    e2 = (2.0 - 1.0 / 298.257223563) / 298.257223563
    n = 6378137.0 / np.sqrt(1.0 - e2 * np.sin(lat) ** 2)
    flat = (n + height_m) * np.cos(lat)
    return np.array([flat * np.cos(lon), flat * np.sin(lon), (n * (1.0 - e2) + height_m) * np.sin(lat)])


def ned_axes(lat_deg, lon_deg):
    lat, lon = np.radians([lat_deg, lon_deg])
    north = [-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)]
    east = [-np.sin(lon), np.cos(lon), 0.0]
    return np.array([north, east, np.cross(north, east)])


def attitude(roll, pitch, yaw):
    """Rz(yaw) Ry(pitch) Rx(roll)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    rz = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    ry = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    rx = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    return rz @ ry @ rx


def pixel(place, angles):
    """The target's pixel: forward, right and down of the camera are the axes of its attitude."""
    ned = ned_axes(*TARGET[:2]) @ (ecef(*TARGET) - ecef(*place))
    forward, right, down = attitude(*angles).T @ ned
    return 2000.0 + 3000.0 * right / forward, 1500.0 + 3000.0 * down / forward


def moved(place, ned):
    lat, lon, alt = place
    return (
        lat + np.degrees(ned[0] / 6.367e6),
        lon + np.degrees(ned[1] / (6.3887e6 * np.cos(np.radians(lat)))),
        alt - ned[2],
    )


def photographs(count, *, seed=1, sigmas=(0.0, 0.0, 0.0), height_m=60.0):
    """(true and claimed pose) of each picture around the target, which is in all of them."""
    draw = np.random.default_rng(seed)
    position_m, height_sigma_m, angle = sigmas
    for _ in range(count):
        tilt, yaw = draw.uniform(0.0, 0.5), draw.uniform(-np.pi, np.pi)
        away = height_m * np.tan(tilt)
        place = moved(TARGET, (-away * np.cos(yaw), -away * np.sin(yaw), -height_m))
        angles = np.array([draw.uniform(-0.1, 0.1), tilt - np.pi / 2, yaw])
        error = draw.normal(size=3) * (position_m, position_m, height_sigma_m)
        turn = attitude(*(draw.normal(size=3) * angle))
        claimed = attitude(*angles) @ turn
        euler = (
            np.arctan2(claimed[2, 1], claimed[2, 2]),
            -np.arcsin(claimed[2, 0]),
            np.arctan2(claimed[1, 0], claimed[0, 0]),
        )
        yield (place, angles), (moved(place, error), euler)


def written(folder, pictures, *, config=FIXED, by="frame", sigmas=""):
    """Writes the files of a flight; returns the words that replay it."""
    rows = [COLUMNS + (",position_sigma_m,height_sigma_m,attitude_sigma_deg" if sigmas else "")]
    frames = []
    for number, (truth, (place, angles)) in enumerate(pictures):
        at = BEGUN_S + 8.0 * number
        key = {"frame": f"{number},", "time": f",{at + 0.004:.3f}"}[by]
        rows.append(f"{key},{place[0]:.9f},{place[1]:.9f},{place[2]:.3f},{_degrees(angles)}{sigmas}")
        u, v = pixel(*truth)
        frames.append(
            {"time_unix": at, "frame": number, "detections": [{"u": u, "v": v, "sigma": 1.0, "label": "rock"}]}
        )
    (folder / "poses.csv").write_text("\n".join(rows) + "\n")
    (folder / "d.jsonl").write_text("".join(json.dumps(frame) + "\n" for frame in frames))
    (folder / "flight.toml").write_text(config)
    (folder / "camera.yaml").write_text(LENS)
    (folder / "truth.csv").write_text(f"label,lat,lon,alt_amsl\nrock,{TARGET[0]},{TARGET[1]},{TARGET[2]}\n")
    words = ["--poses", "poses.csv", "--detections", "d.jsonl", "--config", "flight.toml"]
    return ["replay", *words, "--out", "t.jsonl", "--truth", "truth.csv"]


def _degrees(angles):
    return ",".join(f"{angle:.6f}" for angle in np.degrees(angles))


def lines_of(folder):
    return [json.loads(line) for line in (folder / "t.jsonl").read_text().splitlines()]


WITHOUT_BIASES = [
    word
    for key in ("position_bias_m", "height_bias_m", "heading_bias_deg", "mount_bias_deg")
    for word in ("--set", f"uncertainty.{key}=0")
]


def fixes_of(folder):
    return [line["fix"] for line in lines_of(folder) if line["type"] == "target" and line["fix"]]


TERRAIN = 'terrain = ["N48E011.hgt"]\nterrain_datum = "egm96"'


def flat_model(folder):
    np.full((1201, 1201), TARGET[2], dtype=">i2").tofile(folder / "N48E011.hgt")
