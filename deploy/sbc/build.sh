#!/bin/bash
# Builds what `make sbc-test` boots, into .cache (ignored): root file system, kernel, initrd, wheels. Each part is
# made once; remove it to have it made again. Needs root, network and on Debian 12:
#   qemu-system-arm qemu-user-static mmdebstrap uidmap kmod cpio e2fsprogs gcc-aarch64-linux-gnu libc6-dev-arm64-cross
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
cache=$here/.cache
# The mirror that this machine itself uses, unless told otherwise.
# shellcheck disable=SC2016  # apt fills it in, not the shell
mirror=${MIRROR:-$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' | head -n 1)}
mirror=${mirror%/}
python=${PYTHON:-$here/../../.venv/bin/python}
packages=systemd-sysv,udev,dbus,kmod,iproute2,can-utils,python3,python3-venv
mkdir -p "$cache"
cd "$cache"

make_root() { # in name spaces of its own, so that the host's binfmt_misc stays as it is
    cat >inner.sh <<INNER
set -e
mount -t binfmt_misc binfmt_misc /proc/sys/fs/binfmt_misc 2>/dev/null || true
[ -e /proc/sys/fs/binfmt_misc/qemu-aarch64 ] ||
    cat /usr/lib/binfmt.d/qemu-aarch64.conf >/proc/sys/fs/binfmt_misc/register
rm -rf root
mmdebstrap --quiet --mode=root --arch=arm64 --variant=minbase --include=$packages \
    --skip=check/qemu,chroot/mount/sys,cleanup/apt/lists bookworm root $mirror
rm -rf root/etc/apt/sources.list* root/var/cache/apt root/var/lib/apt/lists/*
INNER
    unshare --mount --pid --fork --mount-proc bash inner.sh ||
        unshare --user --map-users=0,0,65536 --map-groups=0,0,65536 --mount --pid --fork --mount-proc bash inner.sh
}

make_kernel() {
    mkdir -p apt/lists/partial apt/archives/partial apt/etc debs
    : >apt/status
    echo "deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] $mirror bookworm main" >apt/etc/list
    local options=(-o APT::Architecture=arm64 -o APT::Architectures::=arm64 -o Dir::State="$PWD/apt"
        -o Dir::State::Lists="$PWD/apt/lists" -o Dir::State::status="$PWD/apt/status" -o Dir::Cache="$PWD/apt"
        -o Dir::Etc::sourcelist="$PWD/apt/etc/list" -o Dir::Etc::sourceparts=/dev/null)
    apt-get "${options[@]}" update -q
    local image
    image=$(apt-cache "${options[@]}" depends linux-image-arm64 | awk '/Depends: linux-image/{print $2; exit}')
    (cd debs && apt-get "${options[@]}" download "$image" busybox-static)
    rm -rf kernel
    for deb in debs/*.deb; do dpkg-deb -x "$deb" kernel; done
    ls kernel/lib/modules >kver
    depmod -b kernel "$(cat kver)"
    cp "kernel/boot/vmlinuz-$(cat kver)" vmlinuz
    rm -rf root/lib/modules
    mkdir -p root/lib/modules
    cp -a "kernel/lib/modules/$(cat kver)" root/lib/modules/
}

make_initrd() {
    rm -rf initrd
    mkdir -p initrd/bin initrd/lib initrd/new initrd/proc initrd/sys initrd/dev
    cp kernel/bin/busybox initrd/bin/
    ln -s busybox initrd/bin/sh
    for module in virtio_pci virtio_blk ext4; do
        modprobe -d "$PWD/kernel" -S "$(cat kver)" --show-depends "$module"
    done | awk '/^insmod/ && !seen[$2]++ {print $2}' | while read -r file; do
        cp "$file" initrd/lib/
        echo "/lib/$(basename "$file")" >>initrd/modules
    done
    cat >initrd/init <<'INIT'
#!/bin/sh
export PATH=/bin
busybox mount -t proc proc /proc
busybox mount -t sysfs sys /sys
busybox mount -t devtmpfs dev /dev
while read -r module; do busybox insmod "$module"; done </modules
tries=0
while [ ! -b /dev/vda ] && [ $tries -lt 100 ]; do busybox usleep 100000; tries=$((tries + 1)); done
busybox mount -t ext4 -o rw /dev/vda /new || exec sh
busybox mount --move /dev /new/dev
busybox umount /proc
busybox umount /sys
exec busybox switch_root /new /sbin/init
INIT
    chmod +x initrd/init
    (cd initrd && find . | cpio -o -H newc --quiet | gzip) >initrd.gz
}

make_wheels() {
    mkdir -p wheels
    "$python" - >requirements.txt <<'LIST'
import tomllib
project = tomllib.load(open("../../../pyproject.toml", "rb"))["project"]
print(*project["dependencies"], *project["optional-dependencies"]["edge"], sep="\n")
LIST
    "$python" -m pip download -q --disable-pip-version-check -d wheels -r requirements.txt -c "$here/../../constraints.txt" --only-binary=:all: \
        --python-version 3.11 --implementation cp --abi cp311 --abi abi3 --abi none \
        --platform manylinux_2_28_aarch64 --platform manylinux_2_27_aarch64 \
        --platform manylinux_2_17_aarch64 --platform manylinux2014_aarch64
}

[ -d root ] || make_root
[ -e vmlinuz ] || make_kernel
[ -e initrd.gz ] || make_initrd
if [ -z "$(ls wheels 2>/dev/null)" ]; then make_wheels; fi
"$python" "$here/cross_wheel.py" wheels

# The tests start with the board: a service of its own, on the console.
cat >root/etc/systemd/system/sbc-test.service <<'UNIT'
[Unit]
Description=checks of the emulated board
After=multi-user.target
[Service]
Type=oneshot
ExecStart=/bin/bash -c "cp /shared/deploy/sbc/guest.sh /run/ && exec bash /run/guest.sh"
StandardOutput=tty
StandardError=tty
TTYPath=/dev/ttyAMA0
TimeoutStartSec=infinity
ExecStartPre=/bin/mkdir -p /shared
ExecStartPre=/bin/mount -t 9p -o trans=virtio,ro,version=9p2000.L shared /shared
ExecStopPost=/bin/systemctl --no-block poweroff
[Install]
WantedBy=multi-user.target
UNIT
mkdir -p root/etc/systemd/system/multi-user.target.wants
ln -sf ../sbc-test.service root/etc/systemd/system/multi-user.target.wants/sbc-test.service
ln -sf /dev/null root/etc/systemd/system/serial-getty@ttyAMA0.service # the console is the tests'
rm -f board.img
truncate -s 2500M board.img
mke2fs -q -t ext4 -O ^has_journal -d root -F board.img
