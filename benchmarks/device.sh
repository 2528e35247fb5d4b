#!/bin/sh
# Run a command with Tyndall on a bare machine with a GPU and no network.
#
#   benchmarks/device.sh python3 -m tyndall bench volumetric --out "$OUT"
#
# What the machine lacks travels beside the sources: Debian packages of the Vulkan loader in .gl/ (where no libvulkan is
# installed) and wheels in .whl/; other folders by $TYNDALL_DEBS and $TYNDALL_WHEELS. Both are unpacked into a temporary
# folder, and nothing of the machine's own is changed. If the loader finds no driver, set VK_DRIVER_FILES to its .json.
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
debs=${TYNDALL_DEBS:-$root/.gl}
wheels=${TYNDALL_WHEELS:-$root/.whl}
made=$(mktemp -d)
trap 'rm -rf "$made"' EXIT INT TERM

if ! ldconfig -p | grep -q libvulkan; then
    for package in "$debs"/*.deb; do
        dpkg -x "$package" "$made/system"
    done
    libraries=$made/system/usr/lib/$(uname -m)-linux-gnu
    export LD_LIBRARY_PATH="$libraries${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}"
fi
if ls "$wheels"/*.whl >/dev/null 2>&1; then
    python3 -m pip install --quiet --no-index --no-deps --no-compile --no-cache-dir --upgrade \
        --target "$made/site" "$wheels"/*.whl
fi
export PYTHONPATH="$root/src:$made/site${PYTHONPATH:+:$PYTHONPATH}"
export PYTHONUNBUFFERED=1
mkdir -m 700 "$made/runtime"
export XDG_RUNTIME_DIR="$made/runtime"
"$@"
