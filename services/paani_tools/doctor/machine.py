"""Clock, disk, and the runtime folder of this machine. Nothing is changed, but for a file written and removed again."""

from __future__ import annotations

import ctypes
import os
import shutil
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path

import paani
from paani.authority import ensure_credentials, uncertified_in
from paani.certificates import ALL, date_text, identities_of, listener_of
from paani.clock import WallClock
from paani.config import Config
from paani.runtime import runtime_path
from paani_tools.doctor.finding import Verdict, failed, passed, warned
from paani_tools.up.log_files import MAX_BYTES

MIB = 1 << 20
EXPIRES_SOON_S = 14 * 86_400.0
LOG_FILES = 2  # of each process
ROOMY_MIB = 1024.0  # less is told before it hurts
TIMEX_BYTES = 208  # struct timex of Linux, 64 bits; more than enough for 32
TIME_ERROR = 5  # adjtimex(2): the clock is not synchronised


def check_clock(config: Config) -> Iterator[Verdict]:
    """Whether the clock is later than the program, and kept by a time server. The boat itself needs no exact time."""
    installed_s = Path(paani.__file__).stat().st_mtime
    yield judge_clock(WallClock().now_us() * 1e-6, installed_s, _adjtimex())


def judge_clock(now_s: float, installed_s: float, kernel_state: int) -> Verdict:
    """Both times in Unix seconds; kernel_state: as adjtimex(2) returns it, -1 where it may not be asked."""
    if now_s < installed_s:
        behind_h = (installed_s - now_s) / 3600
        return failed(
            f"the clock is {behind_h:.1f} h earlier than when PAANI was installed",
            "set it: timedatectl set-ntp true, or date -s",
        )
    if kernel_state < 0:
        return passed("set; this system does not tell whether a time server keeps it")
    if kernel_state == TIME_ERROR:
        return warned("not kept by a time server; stamps of recordings drift", "timedatectl set-ntp true")
    return passed("set, and kept by a time server")


def _adjtimex() -> int:
    """State of the kernel's clock. Reads only."""
    library = ctypes.CDLL(None, use_errno=True)
    return int(library.adjtimex(ctypes.create_string_buffer(TIMEX_BYTES))) if hasattr(library, "adjtimex") else -1


def check_disk(config: Config) -> Iterator[Verdict]:
    """Space for the logs of all processes and, if there is one, for the recorder; folders that take files."""
    logs_mib = len(config.services) * LOG_FILES * MAX_BYTES / MIB
    yield _space("bus.runtime_dir", runtime_path(config.bus), logs_mib)
    if config.recorder.folder:
        yield _space("recorder.folder", Path(config.recorder.folder), config.recorder.min_free_mib)


def _space(setting: str, folder: Path, needed_mib: float) -> Verdict:
    nearest = _nearest(folder)
    free_mib = shutil.disk_usage(nearest).free / MIB
    text = f"{setting} {folder}: {free_mib:,.0f} MiB free"
    if free_mib < needed_mib:
        return failed(f"{text}, {needed_mib:,.0f} needed", f"make room, or choose another folder (--set {setting}=...)")
    if problem := _write_problem(nearest):
        return failed(f"{setting} {nearest}: {problem}", f"choose a folder that takes files (--set {setting}=...)")
    return warned(text, "make room") if free_mib < max(ROOMY_MIB, 2 * needed_mib) else passed(text)


def _nearest(folder: Path) -> Path:
    """The folder, or the one above it that exists."""
    nearest = folder.absolute()
    while not nearest.exists():
        nearest = nearest.parent
    return nearest


def _write_problem(folder: Path) -> str:
    try:
        with tempfile.NamedTemporaryFile(dir=folder, prefix=".doctor") as file:
            file.write(b"\0")
    except OSError as error:
        return error.strerror or str(error)
    return ""


def check_permissions(config: Config) -> Iterator[Verdict]:
    """The runtime folder holds what opens the bus: its owner's alone."""
    folder = runtime_path(config.bus)
    try:
        found = folder.lstat()
    except FileNotFoundError:
        yield passed(f"bus.runtime_dir {folder}: is made at the first start")
        return
    if stat.S_ISLNK(found.st_mode) or not stat.S_ISDIR(found.st_mode):
        yield failed(f"bus.runtime_dir {folder}: is no folder", "name a folder (--set bus.runtime_dir=...)")
    elif found.st_uid != os.geteuid():
        yield failed(
            f"bus.runtime_dir {folder}: belongs to user {found.st_uid}, not to {os.geteuid()}",
            "run as that user, or choose a folder of your own (--set bus.runtime_dir=...)",
        )
    elif others := [path for path in (folder, *sorted(folder.rglob("*"))) if _is_open(path)]:
        yield failed(f"others may read {', '.join(str(path) for path in others[:3])}", f"chmod -R go-rwx {folder}")
    else:
        yield passed(f"bus.runtime_dir {folder}: for its owner alone")


def check_certificates(config: Config) -> Iterator[Verdict]:
    """What this side's processes need of `bus.certificates` is there, private and in force; the first to expire."""
    folder = config.bus.certificates
    if not folder:
        yield passed("bus.certificates: not set; processes sign in by password")
        return
    identities = identities_of(config.bus)
    if missing := uncertified_in(identities):
        verdict = failed if {*config.services, listener_of(config.bus)}.intersection(missing) else warned
        yield verdict(
            f"bus.certificates {folder}: none for {', '.join(missing)}",
            f"paani certs complete --folder {folder} where the authority's key is, and copy the folder again",
        )
    ensure_credentials(config.bus)
    name, first = min(identities.holders.items(), key=lambda item: item[1].not_after_s)
    text = f"bus.certificates {folder}: {name}.{first.number} is the first to expire, {date_text(first.not_after_s)}"
    if first.not_after_s - WallClock().now_us() * 1e-6 < EXPIRES_SOON_S:
        yield warned(text, f"paani certs rotate {ALL} --folder {folder}, before the next trip")
    else:
        yield passed(text)


def _is_open(path: Path) -> bool:
    """Folders and secrets; logs and routes are no secret, and lie behind the folder."""
    mode = path.lstat().st_mode
    is_secret = stat.S_ISDIR(mode) or path.parent.name.startswith("credentials")
    return is_secret and not stat.S_ISLNK(mode) and bool(mode & 0o077)
