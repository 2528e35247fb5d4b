#!/usr/bin/env bash
# Makes .venv with the locked requirements and the package, and sees to it that a Vulkan adapter answers.
# `make demo` and `make test` call it once; it says what it cannot do in one line and stops.
set -euo pipefail
cd "$(dirname "$0")/.."

fail() {
    echo "setup: $1" >&2
    exit 1
}

# Is $1 a Python of 3.12 or newer?
suits() { "$1" -c 'import sys; sys.exit(sys.version_info < (3, 12))' >/dev/null 2>&1; }

find_python() {
    local candidate
    for candidate in python3.12 python3.13 python3.14 python3 python "${PYENV_ROOT:-$HOME/.pyenv}"/versions/3.1[2-9]*/bin/python3; do
        if suits "$candidate"; then
            echo "$candidate"
            return
        fi
    done
    if command -v uv >/dev/null && candidate=$(uv python find --no-project '>=3.12' 2>/dev/null) && suits "$candidate"; then
        echo "$candidate"
    fi
}

# Install Debian packages as root or through sudo; false where neither is possible.
apt_install() {
    command -v apt-get >/dev/null || return 1
    local as_root=()
    if [ "$(id -u)" != 0 ]; then
        sudo -n true 2>/dev/null || return 1
        as_root=(sudo -n)
    fi
    as_root+=(env DEBIAN_FRONTEND=noninteractive apt-get -qq)
    echo "setup: installing $*"
    "${as_root[@]}" update >/dev/null && "${as_root[@]}" install -y --no-install-recommends "$@" >/dev/null
}

python=$(find_python)
if [ -z "$python" ]; then
    found=$(python3 --version 2>/dev/null || echo "no Python")
    fail "Python 3.12 or newer is needed, and there is $found here: install it (apt-get install python3.12 python3.12-venv, pyenv install 3.12, or uv python install 3.12)"
fi

version=$("$python" -c 'import sys; print(f"{sys.version_info[0]}.{sys.version_info[1]}")')
if ! "$python" -c 'import ensurepip' >/dev/null 2>&1; then # Debian ships Python without it
    apt_install "python$version-venv" || fail "Python's venv module is missing: apt-get install python$version-venv"
fi

echo "setup: .venv with Python $version"
"$python" -m venv --clear .venv
pip=(.venv/bin/python -m pip --disable-pip-version-check --quiet --quiet)
"${pip[@]}" install --require-hashes --requirement requirements.lock
"${pip[@]}" install --no-deps --no-build-isolation --editable .

if ! .venv/bin/tyndall doctor >/dev/null 2>&1; then
    apt_install mesa-vulkan-drivers ||
        fail "no Vulkan adapter answers: install your GPU's driver, or Mesa's software adapter with: apt-get install mesa-vulkan-drivers"
    .venv/bin/tyndall doctor >/dev/null || fail "no Vulkan adapter answers although mesa-vulkan-drivers is installed; see: .venv/bin/tyndall doctor"
fi
