#!/bin/sh
# Installs with apt what pip cannot bring: EGL and Mesa's software OpenGL for the runtime, LLVM for
# Mitsuba, venv for the Python that is used, and the packages named as arguments. Where that needs
# root and we are not, or where there is no apt, it says in one line what to install. It fails only
# for venv: without the libraries `vpltune doctor` still runs, and says what is lost.
set -eu
: "${PYTHON:=python3}"

"$PYTHON" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || {
    echo "setup: Python 3.11 or newer is needed; try: make PYTHON=/path/to/python3.11" >&2
    exit 3
}

missing=""
have() { [ "$(dpkg-query -W -f '${db:Status-Status}' "$1" 2>/dev/null)" = installed ]; }
if command -v dpkg-query >/dev/null 2>&1; then
    for package in libegl1 libegl-mesa0 libgl1 libgl1-mesa-dri "$@"; do
        have "$package" || missing="$missing $package"
    done
fi
# Any LLVM from 16 on serves Mitsuba; Debian 12 has 19 as the newest.
ldconfig=$(command -v ldconfig || echo /sbin/ldconfig)
"$ldconfig" -p 2>/dev/null | grep -Eq 'libLLVM(-|\.so\.)(1[6-9]|2[0-9])' || missing="$missing libllvm19"
"$PYTHON" -c 'import ensurepip, venv' 2>/dev/null || missing="$missing python3-venv"

# moderngl, glcontext and flip-evaluator have no wheels for other processors; pip compiles them.
if [ "$(uname -m)" != x86_64 ]; then
    command -v g++ >/dev/null || missing="$missing g++"
    [ -e /usr/include/X11/Xlib.h ] || missing="$missing libx11-dev"
    "$PYTHON" -c 'import os, sys, sysconfig
sys.exit(not os.path.exists(os.path.join(sysconfig.get_path("include"), "Python.h")))' ||
        missing="$missing python3-dev"
fi

[ -n "$missing" ] || exit 0
if [ "$(id -u)" -eq 0 ] && command -v apt-get >/dev/null 2>&1; then
    echo "setup: system libraries with apt:$missing"
    export DEBIAN_FRONTEND=noninteractive
    log=$(mktemp)
    trap 'rm -f "$log"' EXIT
    install_missing() { apt-get install -y -q --no-install-recommends $missing >"$log" 2>&1; }
    # The package lists may be absent (a bare container) or too old to hold the right addresses.
    install_missing || { apt-get update -q >"$log" 2>&1 && install_missing; } || {
        cat "$log" >&2
        echo "setup: apt could not install:$missing" >&2
    }
else
    echo "setup: not everything will work; run: sudo apt-get install$missing" >&2
fi
"$PYTHON" -c 'import ensurepip, venv' 2>/dev/null || {
    echo "setup: $PYTHON cannot make a virtual environment; run: sudo apt-get install python3-venv" >&2
    exit 3
}
