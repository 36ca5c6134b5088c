#!/bin/bash
# Makes what `python -m tests.bench step --arch arm64` runs an arm64 Python in, into .cache/count (ignored). Each
# part is made once; remove it to have it made again. Needs network and on Debian 12:
#   qemu-user mmdebstrap gcc-aarch64-linux-gnu libc6-dev-arm64-cross
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
cache=$here/.cache/count
python=${PYTHON:-python}
mkdir -p "$cache"
cd "$cache"

# Debian's Python and what it is linked with. Nothing in there is run while it is made: packages are unpacked only.
if [ ! -d root ]; then
    # shellcheck disable=SC2016  # apt fills it in, not the shell
    mirror=${MIRROR:-$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' | head -n 1)}
    rm -rf root.new
    mmdebstrap --quiet --architectures=arm64 --variant=extract \
        --include=python3.11-minimal,libpython3.11-stdlib,libstdc++6 bookworm root.new "${mirror%/}"
    mv root.new root
fi

# `edge run` with a CAN FD sink imports these of the dependencies.
if [ ! -d site ]; then
    rm -rf site.new
    "$python" -m pip install -q --disable-pip-version-check --target site.new -c "$here/../../constraints.txt" \
        --no-deps --only-binary=:all: --python-version 3.11 --implementation cp --abi cp311 --abi abi3 --abi none \
        --platform manylinux_2_28_aarch64 --platform manylinux_2_27_aarch64 \
        --platform manylinux_2_17_aarch64 --platform manylinux2014_aarch64 \
        click msgspec numpy opencv-contrib-python-headless
    mv site.new site
fi

# QEMU's plugin, for this machine.
"${CC:-cc}" -O2 -Wall -Wextra -shared -fPIC "$here/count_blocks.c" -o count_blocks.so
