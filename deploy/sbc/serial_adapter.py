"""A CAN adapter on a serial line that goes bus-off on command; runs on the emulated board.

The kernel's slcan driver sits on one end of a pseudo terminal, this on the other. What the driver sends are
frames as text (`t1818...`); `sb256256` tells it that its controller is bus-off, with both error
counters at 256. From there on everything is the kernel's own: state, carrier, error frame, statistics. QEMU's
CAN controllers have no error counters, and so can never come to that state.

Commands, a line each on standard input; each is answered by a line:
    frames ID N   waits until N more frames with this identifier (three hexadecimal digits) have come
    off           says bus-off
"""

from __future__ import annotations

import fcntl
import os
import pty
import select
import struct
import sys
import tty

TIOCSETD, N_SLCAN = 0x5423, 17  # asm-generic/ioctls.h, linux/tty.h
SIOCGIFNAME = 0x8910  # linux/sockios.h


def main() -> None:
    """Serve until standard input ends."""
    ours, drivers = pty.openpty()
    tty.setraw(drivers)
    fcntl.ioctl(drivers, TIOCSETD, struct.pack("i", N_SLCAN))
    name = fcntl.ioctl(drivers, SIOCGIFNAME, bytes(32)).split(b"\0")[0].decode()
    print(f"interface {name}", flush=True)
    pending, wanted, missing = b"", b"", 0
    while True:
        readable, _, _ = select.select([ours, sys.stdin], [], [])
        if ours in readable:
            *lines, pending = (pending + os.read(ours, 4096)).split(b"\r")
            for line in lines:
                if missing and line.startswith(wanted):
                    missing -= 1
                    if not missing:
                        print(f"came {line.decode()}", flush=True)
        if sys.stdin in readable:
            words = sys.stdin.readline().split()
            if not words:
                return
            if words[0] == "off":
                os.write(ours, b"sb256256\r")
                print("told", flush=True)
            else:
                wanted, missing = b"t" + words[1].encode(), int(words[2])


if __name__ == "__main__":
    main()
