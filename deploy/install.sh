#!/bin/sh
# Installs voronoi-touch as a service, for Debian 12 and later and Raspberry Pi OS, arm64 and amd64.
#
#   sudo deploy/install.sh                       install, or upgrade; may be run again and again
#   sudo deploy/install.sh --finger index        ... and set up the finger "index" as node 1
#   sudo deploy/install.sh --rollback            back to the release before
#   sudo deploy/install.sh --uninstall           remove the software; settings and calibrations stay
#   sudo deploy/install.sh --uninstall --purge   ... and those too
#
# Where things go
#   /opt/voronoi-touch/releases/TIME   one virtual environment a release; the last two are kept
#   /opt/voronoi-touch/current         the release in use; switching it is the upgrade, and the way back
#   /etc/voronoi-touch/FINGER.toml     configuration; never overwritten
#   /var/lib/voronoi-touch/FINGER      settings and uploaded calibration; no installation touches it
#
# Options
#   --wheels DIR     install from wheels in DIR, without network. To make them, in the checkout, on a machine of
#                    the same architecture and Python: pip wheel -w DIR -c constraints.txt '.[edge]'
#   --camera KIND    picamera: a CSI camera of a Raspberry Pi; its picamera2 is Debian's package, which the
#                    virtual environment then sees; none: another camera, which needs no such thing. Not given: as
#                    in the release in use
#   --extras LIST    beside edge: oak for OAK modules, view for the live page; oak,view for both. What the release in
#                    use has is kept; to be rid of it, --uninstall first, which leaves the settings
#   --node N         CANopen node of --finger, default 1
#   --no-start       do not enable and start anything
#   --root DIR       install below DIR (an image of a board); user, services and modules are then left alone
set -eu
umask 022 # the service reads what root installs, whatever root's own umask is; nobody else writes it

here=$(cd "$(dirname "$0")" && pwd)
action=install finger='' node=1 wheels='' extras='' camera='' start=1 purge=0 root=''

fail() {
    echo "install: $*" >&2
    exit 2
}
say() { echo "install: $*"; }

while [ $# -gt 0 ]; do
    case $1 in
    --uninstall) action=uninstall ;;
    --rollback) action=rollback ;;
    --upgrade) action=install ;;
    --purge) purge=1 ;;
    --no-start) start=0 ;;
    --finger | --node | --wheels | --extras | --camera | --root)
        [ $# -ge 2 ] || fail "$1 needs a value"
        case $1 in
        --finger) finger=$2 ;;
        --node) node=$2 ;;
        --wheels) wheels=$(cd "$2" 2>/dev/null && pwd) || fail "--wheels $2: no such folder" ;;
        --extras) extras=$2 ;;
        --camera) camera=$2 ;;
        --root) root=$(cd "$2" 2>/dev/null && pwd) || fail "--root $2: no such folder" ;;
        esac
        shift
        ;;
    -h | --help)
        sed -n '2,/^set -eu/s/^# \{0,1\}//p' "$0"
        exit 0
        ;;
    *) fail "unknown option $1; see --help" ;;
    esac
    shift
done

case $finger in *[!a-z0-9_-]*) fail "--finger $finger: use a-z, 0-9, - and _" ;; esac
[ ${#finger} -le 32 ] || fail "--finger $finger: 32 characters at most"
case $node in '' | 0* | *[!0-9]* | ????*) fail "--node $node: a number from 1 to 127, without zeros before it" ;; esac
[ "$node" -le 127 ] || fail "--node $node: a number from 1 to 127"
case $extras in *[!a-z,]*) fail "--extras $extras: names with commas between them, e.g. oak,view" ;; esac
case $camera in '' | picamera | none) ;; *) fail "--camera $camera: picamera or none, or leave it away" ;; esac

opt=/opt/voronoi-touch
etc=$root/etc/voronoi-touch
state=$root/var/lib/voronoi-touch
units=$root/etc/systemd/system
rules=$root/etc/udev/rules.d
network=$root/etc/systemd/network
account=voronoi-touch

[ -n "$root" ] || [ "$(id -u)" = 0 ] || fail "must be root: sudo $0"

# Whether a running system is to be notified, and not an image of one.
running() { [ -z "$root" ] && [ -d /run/systemd/system ]; }
fingers() { for file in "$etc"/*.toml; do [ ! -e "$file" ] || basename "$file" .toml; done; }
# The release that a link names, "" where there is none.
release_of() { readlink "$1" 2>/dev/null || true; }
switch_to() { # atomic: a start at any moment finds the old or the new one
    ln -s "$1" "$root$opt/current.new"
    mv -T "$root$opt/current.new" "$root$opt/current"
}
restart() {
    running || return 0
    for each in $(fingers); do
        if systemctl is-active --quiet "voronoi-touch@$each"; then systemctl restart "voronoi-touch@$each"; fi
    done
}

uninstall() {
    if running; then
        for each in $(fingers); do systemctl disable --now "voronoi-touch@$each" 2>/dev/null || true; done
    fi
    rm -f "$units/voronoi-touch@.service" "$rules/70-voronoi-touch.rules" "$network/80-voronoi-touch-can.network"
    rm -rf "$root$opt"
    if [ "$purge" = 1 ]; then
        rm -rf "$etc" "$state"
        if [ -z "$root" ] && id "$account" >/dev/null 2>&1; then userdel "$account"; fi
    fi
    if running; then
        systemctl daemon-reload
        udevadm control --reload
    fi
    if [ "$purge" = 1 ]; then say "removed, with settings"; else say "removed; $etc and $state are kept"; fi
}

rollback() {
    before=$(release_of "$root$opt/previous")
    if [ -z "$before" ] || [ ! -d "$root$before" ]; then fail "no release to go back to"; fi
    now=$(release_of "$root$opt/current")
    switch_to "$before"
    ln -sfn "$now" "$root$opt/previous"
    restart
    say "back at $(basename "$before"); again to return to $(basename "$now")"
}

# Cuts off what lies behind the last part of a library that is loaded: debug information, symbols of no use to
# others, and the table of sections. A board has no `strip` that would.
cut='
import struct, sys
for path in sys.argv[1:]:
    with open(path, "r+b") as file:
        elf = bytearray(file.read())
        if elf[:6] != b"\x7fELF\2\1":  # 64 bits, little-endian
            continue
        table_at, = struct.unpack_from("<Q", elf, 32)
        size, parts_n = struct.unpack_from("<HH", elf, 54)
        table_end = table_at + size * parts_n
        parts = [struct.unpack_from("<8xQ16xQ", elf, at) for at in range(table_at, table_end, size)]
        struct.pack_into("<Q", elf, 40, 0)
        struct.pack_into("<HH", elf, 60, 0, 0)
        file.seek(0)
        file.write(elf[:64])
        file.truncate(max(table_end, *(begin + length for begin, length in parts)))
'

# What is not said is as in the release in use: an upgrade takes nothing away.
recall_options() {
    now=$(release_of "$root$opt/current")
    if [ -z "$camera" ] && [ -n "$now" ] && grep -qs '^include-system-site-packages = true' "$root$now/pyvenv.cfg"; then
        camera=picamera
    fi
    had=$([ -z "$now" ] || cat "$root$now/extras" 2>/dev/null || true)
    extras=$(echo "edge,$had,$extras" | tr , '\n' | awk 'NF && !seen[$0]++' | paste -sd , -)
}

make_release() {
    command -v python3 >/dev/null || fail "python3 is missing: apt-get install python3 python3-venv"
    python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' || fail "Python 3.11 or later is needed"
    python3 -c 'import venv, ensurepip' 2>/dev/null || fail "python3-venv is missing: apt-get install python3-venv"
    fresh=$opt/releases/$(date -u +%Y%m%dT%H%M%S)
    while [ -e "$root$fresh" ]; do fresh=$fresh+; done
    mkdir -p "$root$opt/releases"
    work=$(mktemp -d)
    trap 'rm -rf "$work" "$root$fresh"' EXIT # a half-made release is none
    if [ "$camera" = picamera ]; then
        python3 -c 'import importlib.util, sys; sys.exit(importlib.util.find_spec("picamera2") is None)' ||
            fail "picamera2 is missing: apt-get install python3-picamera2"
        python3 -m venv --system-site-packages "$root$fresh"
    else
        python3 -m venv "$root$fresh"
    fi
    set -- --quiet --disable-pip-version-check --constraint "$here/../constraints.txt"
    if [ -n "$wheels" ]; then
        "$root$fresh/bin/python" -m pip install "$@" --no-index --find-links "$wheels" "voronoi-touch[$extras]"
    else # from a copy: a build leaves files, and root's have no place in somebody's checkout
        (cd "$here/.." && tar -cf - --exclude=./.git --exclude=./.venv --exclude=./build --exclude=./out .) |
            tar -xf - --no-same-owner -C "$work"
        "$root$fresh/bin/python" -m pip install "$@" "${work}[$extras]"
    fi
    # The next release brings its own pip; `current/bin/python -m ensurepip` brings one back to this one.
    "$root$fresh/bin/python" -m pip uninstall --quiet --disable-pip-version-check --yes pip setuptools 2>/dev/null \
        || fail "pip could not be removed from the new release"
    # No finger runs NumPy's tests or zstandard's build for other interpreters, nor reads debug information.
    find "$root$fresh/lib" -type d -path '*/site-packages/numpy/*' -name tests -prune -exec rm -r {} +
    find "$root$fresh/lib" -path '*/site-packages/zstandard/_cffi.*.so' -exec rm {} +
    for each in lz4 msgpack zstandard; do
        find "$root$fresh/lib" -path "*/site-packages/$each/*.so" -exec "$root$fresh/bin/python" -c "$cut" {} +
    done
    (cd / && "$root$fresh/bin/python" -m edge --version) || fail "the new release does not run"
    echo "$extras" >"$root$fresh/extras"
    rm -rf "$work"
    trap - EXIT
    switch_to "$fresh"
    [ -z "$now" ] || ln -sfn "$now" "$root$opt/previous"
    for old in "$root$opt"/releases/*; do
        case ${old#"$root"} in "$fresh" | "$now") ;; *) rm -rf "$old" ;; esac
    done
    say "release $(basename "$fresh"), with $extras${camera:+, camera $camera}"
}

# Nothing is begun with a folder that lacks something.
check_folder() {
    for each in 70-voronoi-touch.rules 80-voronoi-touch-can.network edge.toml voronoi-touch@.service ../constraints.txt; do
        [ -e "$here/$each" ] || fail "$here/$each is missing: run it in a whole checkout"
    done
    [ -n "$wheels" ] || [ -e "$here/../pyproject.toml" ] ||
        fail "$here/../pyproject.toml is missing: run it in a whole checkout, or give --wheels DIR"
}

install_files() {
    mkdir -p "$etc" "$state" "$units" "$rules" "$network"
    install -m 644 "$here/voronoi-touch@.service" "$units/"
    install -m 644 "$here/70-voronoi-touch.rules" "$rules/"
    install -m 644 "$here/80-voronoi-touch-can.network" "$network/"
    if [ -z "$root" ]; then
        if ! id "$account" >/dev/null 2>&1; then
            useradd --system --user-group --home-dir "$state" --no-create-home --shell /usr/sbin/nologin "$account"
        fi
        for group in video dialout; do
            getent group "$group" >/dev/null || groupadd --system "$group"
            usermod --append --groups "$group" "$account"
        done
    fi
    if running; then
        systemctl daemon-reload
        if udevadm control --reload 2>/dev/null; then udevadm trigger --subsystem-match=video4linux; fi
        if systemctl is-active --quiet systemd-networkd; then networkctl reload; fi
    fi
}

set_up_finger() {
    file=$etc/$finger.toml
    if [ -e "$file" ]; then
        say "$file is kept"
    else
        spec=v4l2:0
        [ "$camera" != picamera ] || spec=picamera:0
        sed -e "s|^serial = .*|serial = \"$finger\"|" -e "s|^node_id = [0-9]*|node_id = $node|" \
            -e "s|^sinks = \[\]|sinks = [\"can:can0\"]|" -e "s|^spec = \"v4l2:0\"|spec = \"$spec\"|" \
            -e "s|^directory = \"\"|directory = \"/var/lib/voronoi-touch/$finger\"|" "$here/edge.toml" >"$file"
        say "$file made; look at [source] and [link]"
    fi
    if running && [ "$start" = 1 ]; then systemctl enable --now "voronoi-touch@$finger"; fi
}

case $action in
uninstall) uninstall ;;
rollback) rollback ;;
install)
    check_folder
    install_files
    recall_options
    make_release
    if [ -n "$finger" ]; then set_up_finger; fi
    restart
    some=${finger:-$(fingers | head -n 1)}
    if [ -n "$some" ]; then
        say "done; next: $opt/current/bin/python -m edge doctor --config $etc/$some.toml"
    else
        say "done; next: $0 --finger NAME --node N, which sets a finger up"
    fi
    ;;
esac
