"""Makes a checkout ready: system packages, virtual environment, editable install.

`python3 tools/set_up.py run` prepares what the program needs, `… test` also what tests and checks need.
Uses the standard library alone and returns at once where nothing is left to do: `.venv/set-up.json` keeps
what was installed for which pyproject.toml and which Python.
"""

import hashlib
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
STAMP = VENV / "set-up.json"
OLDEST, NEWEST = (3, 11), (3, 13)

WINDOW_PACKAGES = [
    *("libegl1", "libegl-mesa0", "libgl1", "libgl1-mesa-dri", "libopengl0", "libgomp1", "libdbus-1-3"),
    *("libfontconfig1", "libglib2.0-0", "libx11-xcb1", "libxkbcommon0", "libxkbcommon-x11-0"),
    *("libxcb-cursor0", "libxcb-icccm4", "libxcb-image0", "libxcb-keysyms1", "libxcb-randr0"),
    *("libxcb-render-util0", "libxcb-xfixes0", "libxcb-shape0", "libxcb-shm0", "libxcb-sync1"),
    *("libxcb-util1", "libxcb-xkb1", "libxcb-glx0"),
]
TEST_PACKAGES = ["xvfb", "gcc", "libc6-dev", "libllvm19"]  # a screen, the disk-fault shim, Mitsuba's llvm
LIBRARIES = ["libEGL.so.1", "libGL.so.1", "libxkbcommon.so.0", "libxcb-cursor.so.0"]  # where no dpkg is


def main(purpose: str) -> None:
    """Bring everything up to date for `run` or `test`."""
    check_python()
    stamp = read_stamp()
    packages = WINDOW_PACKAGES + (TEST_PACKAGES if purpose == "test" else [])
    tried = ensure_packages(packages, stamp.get("packages_tried", []))
    if stamp.get("python") != python_key():
        make_environment()
        stamp = {}
    extras = "test" if "test" in (purpose, stamp.get("extras")) else ""
    if (stamp.get("project"), stamp.get("extras")) != (project_key(), extras):
        install(extras)
    write_stamp({"python": python_key(), "project": project_key(), "extras": extras, "packages_tried": tried})


def check_python() -> None:
    """Stop in one line where this Python is too old or too new."""
    if not OLDEST <= sys.version_info[:2] <= NEWEST:
        wanted = " to ".join(".".join(map(str, version)) for version in (OLDEST, NEWEST))
        have = "{}.{}".format(*sys.version_info)
        stop(f"Lucarne needs Python {wanted}, {sys.executable} is {have}: say `make PYTHON=python3.11 …`.")


def python_key() -> str:
    """What a virtual environment is bound to: this Python, and where the checkout lies."""
    return f"{sys.version}|{sys.base_prefix}|{ROOT}"


def project_key() -> str:
    """Digest of what is to be installed."""
    return hashlib.sha256((ROOT / "pyproject.toml").read_bytes()).hexdigest()


def read_stamp() -> dict:
    """What the last set-up left behind; empty when the environment is not there."""
    try:
        found = json.loads(STAMP.read_text()) if python().exists() else {}
        return found if isinstance(found, dict) else {}
    except (OSError, ValueError):
        return {}


def write_stamp(stamp: dict) -> None:
    """Remember what was done."""
    text = json.dumps(stamp, indent=1)
    if not STAMP.exists() or STAMP.read_text() != text:
        STAMP.write_text(text)


def ensure_packages(packages: list, tried: list) -> list:
    """Install what is missing with apt where that is allowed; the packages that could not be had.

    What failed once is named again, but not tried again until the list changes (`make clean` forgets).
    """
    missing = missing_packages(packages) if sys.platform.startswith("linux") else []
    if missing and missing != tried and apt_install(missing):
        missing = missing_packages(packages)
    if missing:
        names = " ".join(missing)
        say(f"Missing system packages (window and its tests may not start): apt-get install {names}")
    return missing


def missing_packages(packages: list) -> list:
    """Which of these Debian packages are not installed; elsewhere, which libraries cannot be found."""
    if shutil.which("dpkg-query") is None:
        ldconfig = shutil.which("ldconfig", path=os.environ.get("PATH", "") + ":/sbin:/usr/sbin")
        known = output([ldconfig, "-p"]) if ldconfig else " ".join(LIBRARIES)
        return [library for library in LIBRARIES if library not in known]
    lines = output(["dpkg-query", "-W", "-f", "${db:Status-Abbrev} ${Package}\n", *packages]).splitlines()
    installed = {line.split()[-1] for line in lines if line.startswith("ii")}
    return [package for package in packages if package not in installed]


def apt_install(packages: list) -> bool:
    """Whether apt could be run for these packages; one that does not exist leaves out itself only."""
    prefix = privilege()
    if prefix is None or shutil.which("apt-get") is None:
        return False
    say(f"Installing system packages: {' '.join(packages)}")
    environment = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    patience = [
        "-o",
        "Acquire::Retries=2",
        "-o",
        "Acquire::http::Timeout=30",
        "-o",
        "DPkg::Lock::Timeout=120",
    ]
    apt = [*prefix, "apt-get", "-q", "-y", *patience]

    def run(*arguments: str) -> bool:
        command = [*apt, *arguments]
        return subprocess.run(command, env=environment, stdin=subprocess.DEVNULL).returncode == 0

    run("update")
    known = [name for name in packages if output(["apt-cache", "show", "--no-all-versions", name]).strip()]
    return bool(known) and run("install", "--no-install-recommends", *known)


def privilege() -> "list | None":
    """What a command needs before it to run as root: nothing, `sudo -n`, or None when neither is allowed."""
    if os.geteuid() == 0:
        return []
    sudo = shutil.which("sudo")
    if sudo and subprocess.run([sudo, "-n", "true"], capture_output=True, check=False).returncode == 0:
        return [sudo, "-n"]
    return None


def make_environment() -> None:
    """A fresh virtual environment; on Debian the package that can make one is installed first."""
    if not can_make_environment():
        version = "python{}.{}-venv".format(*sys.version_info)
        names = ["python3-venv", version]
        apt_install(names)
        if not can_make_environment():
            stop(f"Python cannot make virtual environments here: apt-get install {' '.join(names)}")
    say(f"Making {VENV.relative_to(ROOT)} with Python {sys.version.split()[0]}")
    run_or_stop(
        [sys.executable, "-m", "venv", "--clear", str(VENV)], "the virtual environment could not be made"
    )


def can_make_environment() -> bool:
    """Whether `venv` and `ensurepip` are there (Debian packs them apart from Python)."""
    probe = [sys.executable, "-c", "import venv, ensurepip"]
    return subprocess.run(probe, capture_output=True, check=False).returncode == 0


def install(extras: str) -> None:
    """The checkout, editable, with its dependencies."""
    what = f"{ROOT}[{extras}]" if extras else str(ROOT)
    say("Installing Lucarne and its dependencies (some minutes the first time)")
    started = time.monotonic()
    pip = [str(python()), "-m", "pip", "install", "--disable-pip-version-check", "--no-input", "--editable"]
    run_or_stop([*pip, what], "the dependencies could not be installed; see pip's message above")
    say(f"Installed in {time.monotonic() - started:.0f} s")


def python() -> Path:
    """The environment's interpreter."""
    return VENV / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def output(command: list) -> str:
    """What a command prints, whatever its exit status."""
    done = subprocess.run(command, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
    return done.stdout


def run_or_stop(command: list, message: str) -> None:
    """Run a command in the open, and stop with `message` when it fails."""
    if subprocess.run(command, stdin=subprocess.DEVNULL, cwd=ROOT, check=False).returncode != 0:
        stop(message)


def say(line: str) -> None:
    """One line of progress."""
    print(f"[set-up] {line}", file=sys.stderr, flush=True)


def stop(line: str) -> None:
    """End here, with the reason."""
    say(line)
    sys.exit(1)


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "run")
