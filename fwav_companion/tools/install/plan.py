"""The steps of an installation, decided from the observed system. PURE."""

from __future__ import annotations

import re
from collections.abc import Iterator

import msgspec

from fwav_companion.config import Config, parse
from fwav_companion.errors import ConfigError, UserError
from fwav_companion.tools.install import network_access, serial_port
from fwav_companion.tools.install.steps import (
    AwaitHeartbeat,
    MakeEnvironment,
    PointLink,
    Remark,
    RemovePath,
    RenamePath,
    Run,
    Step,
    WriteFile,
)
from fwav_companion.tools.install.system import (
    BOOT_FOLDERS,
    CAMERA_FILE,
    COMMAND,
    CONFIGURATION,
    ENVIRONMENT,
    HOME,
    NETWORK_DROP_IN,
    PROGRAM,
    RECORD,
    SERVICE,
    UDEV_RULES,
    UNIT,
    USERS,
    Installed,
    Package,
    Request,
    System,
)

SYSUSERS = """# Written by `fwav-companion install`. dialout: serial ports; video: cameras.
g dialout - -
g video - -
u fwav-companion - "fwav-companion" - -
"""
RELOAD_UNITS = Run(command=("systemctl", "daemon-reload"))
RESTART = Run(command=("systemctl", "restart", SERVICE), optional=True)
"""Restart of the service. It is optional because the heartbeat shows whether the service runs."""


def plan(system: System, source: Package, request: Request) -> list[Step]:
    """Return the steps, in order; only remarks where nothing is to be done. UserError for an unknown extra."""
    if request.uninstall:
        return list(_uninstall(system))
    unknown = [extra for extra in request.extras if extra not in source.extras]
    if unknown:
        raise UserError(f"install --with {unknown[0]}: no such extra; accepted: {', '.join(source.extras)}")
    written = list(_files(system, source))
    config = _config(system, source)
    if isinstance(config, ConfigError):
        written.append(Remark(text=f"{config}; correct it and run install again"))
    else:
        written += _network(system, source, config)
    environment = list(_environment(system, source, request, config))
    steps: list[Step] = [*_user(system), *environment, *_command(system), *written]
    changed = any(isinstance(step, WriteFile | RemovePath | MakeEnvironment) for step in steps)
    steps += _service(system, steps, changed=changed)
    if not isinstance(config, ConfigError):
        steps += _serial(system, request, config)
    return steps


# Files.


def _user(system: System) -> Iterator[Step]:
    """Yield the service's user and its groups; systemd-sysusers leaves those that exist."""
    if system.texts.get(USERS) != SYSUSERS:
        yield WriteFile(path=USERS, content=SYSUSERS)
        where = () if system.is_running_system else (f"--root={system.root}",)
        yield Run(command=("systemd-sysusers", *where, USERS.rpartition("/")[2]), optional=not system.is_running_system)


def _files(system: System, source: Package) -> Iterator[Step]:
    """Yield unit, udev rules and configuration. Unit and rules are ours; a configuration that exists is the user's."""
    for path in (UNIT, UDEV_RULES):
        content = source.files[path.rpartition("/")[2]]
        if system.texts.get(path) != content:
            yield WriteFile(path=path, content=content)
    for path in (CONFIGURATION, CAMERA_FILE):
        content = source.files[path.rpartition("/")[2]]
        if path not in system.texts:
            yield WriteFile(path=path, content=content)
        elif system.texts[path] != content:
            yield Remark(text=f"{path} is yours: left as it is")


def _config(system: System, source: Package) -> Config | ConfigError:
    """Return the configuration that the service will run with, or what is wrong with it."""
    try:
        return parse(system.texts.get(CONFIGURATION, source.files["fwav-companion.toml"]), CONFIGURATION)
    except ConfigError as error:
        return error


def _network(system: System, source: Package, config: Config) -> Iterator[Step]:
    """Yield the limits of the network by the configured links; the sample's links are still to be set."""
    if system.texts.get(CONFIGURATION, source.files["fwav-companion.toml"]) == source.files["fwav-companion.toml"]:
        yield Remark(text="the network is not limited: set the links, then run install again")
        return
    try:
        content = network_access.drop_in(config)
    except network_access.OpenAccessError as error:
        yield Remark(text=f"the network is not limited: {error}")
        if NETWORK_DROP_IN in system.texts:
            yield RemovePath(path=NETWORK_DROP_IN)
        return
    if system.texts.get(NETWORK_DROP_IN) != content:
        yield WriteFile(path=NETWORK_DROP_IN, content=content)


# The environment.


def _environment(system: System, source: Package, request: Request, config: Config | ConfigError) -> Iterator[Step]:
    wanted = _wanted(system, source, request, config)
    if system.installed == wanted and system.environment and not request.upgrade:
        return
    name = _next_name(system.environments)
    if system.environment_is_folder:  # its scripts go on working through a link of the same name
        old = f"{HOME}/{_next_name((*system.environments, name))}"
        yield RenamePath(path=ENVIRONMENT, to=old)
        yield PointLink(path=ENVIRONMENT, target=old)
    small = system.platform.is_32_bit_arm
    yield MakeEnvironment(
        path=f"{HOME}/{name}",
        source=source.path,
        extras=wanted.extras,
        locks=() if small else _locks(source, wanted.extras),
        system_packages=wanted.system_packages,
        linux32=system.platform.needs_linux32,
    )
    if small:
        yield Remark(text="32-bit system: relay, and detections of another program by UDP; no camera of its own")
    yield PointLink(path=ENVIRONMENT, target=f"{HOME}/{name}")
    yield WriteFile(path=RECORD, content=_encoded(wanted))


def _wanted(system: System, source: Package, request: Request, config: Config | ConfigError) -> Installed:
    """Return the sources of the wanted environment; extras that were installed before stay."""
    before = system.installed or Installed()
    extras = sorted({*request.extras, *(extra for extra in before.extras if extra in source.extras)})
    return Installed(version=source.version, extras=tuple(extras), system_packages=_sees_system(config, before))


def _sees_system(config: Config | ConfigError, before: Installed) -> bool:
    """Return whether a Raspberry Pi camera is configured: picamera2 is a package of the system."""
    if isinstance(config, ConfigError) or config.vision is None:
        return before.system_packages if isinstance(config, ConfigError) else False
    return config.vision.source.startswith("libcamera:")


def _locks(source: Package, extras: tuple[str, ...]) -> tuple[str, ...]:
    """Return the lock files of these extras; all sets have the same versions, so that they can be combined."""
    names = [f"board-{extra}.txt" for extra in extras if f"board-{extra}.txt" in source.locks] or ["board.txt"]
    names += ["build.txt"] if source.path else []
    return tuple(source.locks[name] for name in names) if set(names) <= set(source.locks) else ()


def _next_name(names: tuple[str, ...]) -> str:
    numbers = [int(found[1]) for name in names if (found := re.fullmatch(r"venv-(\d+)", name))]
    return f"venv-{max(numbers, default=0) + 1}"


def _encoded(installed: Installed) -> str:
    return msgspec.json.format(msgspec.json.encode(installed), indent=1).decode() + "\n"


def _command(system: System) -> Iterator[Step]:
    """Yield the link by which every shell finds the program; a file of that name that is not ours stays."""
    if system.command is None:
        yield PointLink(path=COMMAND, target=PROGRAM)
    elif system.command != PROGRAM:
        yield Remark(text=f"{COMMAND} is yours: left as it is; the service's own program is {PROGRAM}")


# The service.


def _service(system: System, steps: list[Step], *, changed: bool) -> Iterator[Step]:
    """Yield steps that make systemd and udev take the changes; a root that does not run gets only `enable`'s link."""
    if not changed:
        if all(isinstance(step, Remark) for step in steps):
            yield Remark(text="all of it is there already")
        return
    if not system.is_running_system or not system.has_systemd:
        yield PointLink(path=f"/etc/systemd/system/multi-user.target.wants/{SERVICE}.service", target=UNIT)
        return
    yield Run(command=("systemd-analyze", "verify", UNIT), optional=True)
    yield RELOAD_UNITS
    if any(isinstance(step, WriteFile) and step.path == UDEV_RULES for step in steps):
        yield Run(command=("udevadm", "control", "--reload"), optional=True)
        yield Run(command=("udevadm", "trigger", "--subsystem-match=tty"), optional=True)
    yield Run(command=("systemctl", "enable", SERVICE))
    yield RESTART
    yield AwaitHeartbeat(otherwise=tuple(_way_back(system, steps)))
    if any(isinstance(step, MakeEnvironment) for step in steps):
        for name in system.environments:
            if name != system.environment:  # the one before stays, to go back by hand
                yield RemovePath(path=f"{HOME}/{name}")


def _way_back(system: System, steps: list[Step]) -> Iterator[PointLink | Run | WriteFile | RemovePath]:
    """Yield the steps back to the old environment and unit."""
    made = next((step for step in steps if isinstance(step, MakeEnvironment)), None)
    if made is None or not system.environment:
        return
    adopted = next((step.to for step in steps if isinstance(step, RenamePath)), "")
    yield PointLink(path=ENVIRONMENT, target=adopted or f"{HOME}/{system.environment}")
    for step in steps:
        if isinstance(step, WriteFile) and step.path in (UNIT, NETWORK_DROP_IN, RECORD):
            before = system.texts.get(step.path)
            yield RemovePath(path=step.path) if before is None else WriteFile(path=step.path, content=before)
    yield RELOAD_UNITS
    yield RESTART
    yield RemovePath(path=made.path)


def _uninstall(system: System) -> Iterator[Step]:
    if system.is_running_system and system.has_systemd and UNIT in system.texts:
        yield Run(command=("systemctl", "disable", "--now", SERVICE), optional=True)
    wanted_by = f"/etc/systemd/system/multi-user.target.wants/{SERVICE}.service"
    for path in (wanted_by, NETWORK_DROP_IN, NETWORK_DROP_IN.rpartition("/")[0], UNIT, UDEV_RULES, USERS, HOME):
        yield RemovePath(path=path)
    if system.command == PROGRAM:
        yield RemovePath(path=COMMAND)
    if system.is_running_system and system.has_systemd:
        yield RELOAD_UNITS
    yield Remark(text=f"left: {CONFIGURATION}, /var/lib/{SERVICE} and the user {SERVICE}")


# The serial port.


def _serial(system: System, request: Request, config: Config) -> Iterator[Step]:
    """Yield the obstacles to a Raspberry Pi's serial port and, with ``--boot``, the boot files without them."""
    port = serial_port.gpio_port(config)
    if not system.model or not port:
        return
    folder = next((each for each in BOOT_FOLDERS if f"{each}/config.txt" in system.texts), "")
    if not folder:
        yield Remark(text=f"no config.txt in {' or '.join(BOOT_FOLDERS)}: the serial port is not examined")
        return
    paths = (f"{folder}/cmdline.txt", f"{folder}/config.txt")
    cmdline, config_txt = (system.texts.get(path, "") for path in paths)
    found = list(serial_port.obstacles(port, system.model, cmdline, config_txt))
    for obstacle in found:
        yield Remark(text=f"{port}: {obstacle.problem}")
    settings = [obstacle.setting for obstacle in found if obstacle.setting]
    changes = {paths[0]: serial_port.without_console(cmdline)} if serial_port.CONSOLE.search(cmdline) else {}
    if settings:
        changes[paths[1]] = serial_port.with_settings(config_txt, settings)
    if not changes:
        return
    if not request.boot:
        yield Remark(text="run install --boot to change the boot files (copies are kept)")
        return
    for path, content in changes.items():
        yield WriteFile(path=path, content=content, mode=0o755, keep=f"{path}.before-{SERVICE}")
    yield Remark(text="reboot for the serial port")
