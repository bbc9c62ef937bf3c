"""The versions and the processor of a worker. Sent to workers by value, because they may lack this package."""

from __future__ import annotations


def worker_facts() -> dict[str, object]:
    """Version of the package (empty without it), of the libraries that compute, of Python; model of the processor."""
    import platform
    from importlib import import_module, metadata

    try:
        package = str(import_module("fwav_companion").__version__)
    except ImportError:
        package = ""
    wheels = {"python": platform.python_version()}
    for name in ("msgspec", "numpy", "pymavlink", "scipy"):
        try:
            wheels[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            wheels[name] = ""
    processor = platform.machine()
    try:
        with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as file:  # noqa: PTH123  # sent by value
            for line in file:
                if line.startswith("model name"):
                    processor = f"{processor} {line.partition(':')[2].strip()}"
                    break
    except OSError:
        pass
    return {"package": package, "wheels": wheels, "processor": processor}


def cpu_seconds() -> float:
    """CPU time of this worker and its mocks so far, those that have ended included, seconds."""
    from importlib import import_module

    psutil = import_module("psutil")  # comes with Dask, wherever a worker runs

    total = 0.0
    for process in (psutil.Process(), *psutil.Process().children(recursive=True)):
        try:
            times = process.cpu_times()
        except psutil.NoSuchProcess:
            continue
        total += times.user + times.system + times.children_user + times.children_system
    return total
