"""`make sbc-test`: boots the emulated board, watches its console, writes RESULT.md.

What it boots is made by build.sh; what runs on it is guest.sh.

No KVM is needed: QEMU's own translation. Its times say nothing about real boards.
"""

from __future__ import annotations

import subprocess
import sys
import time
from datetime import UTC, datetime
from pathlib import Path

HERE = Path(__file__).resolve().parent
CACHE, ROOT = HERE / ".cache", HERE.parents[1]
LONGEST_S = 2400
REPLAY = "-m edge replay tests/data/press.mcap --speed max --sink memory: --samples -q"

COMMAND = [
    "qemu-system-aarch64", "-M", "virt", "-cpu", "cortex-a72", "-m", "1536", "-smp", "2", "-display", "none",
    "-no-reboot", "-snapshot", "-kernel", str(CACHE / "vmlinuz"), "-initrd", str(CACHE / "initrd.gz"),
    "-append", "console=ttyAMA0 quiet net.ifnames=0 panic=-1",
    "-drive", f"if=none,id=d0,format=raw,file={CACHE / 'board.img'}", "-device", "virtio-blk-pci,drive=d0",
    "-device", "virtio-rng-pci", "-nic", "none", "-serial", "stdio", "-monitor", "none",
    "-virtfs", f"local,path={ROOT},mount_tag=shared,security_model=none,readonly=on",
    "-object", "can-bus,id=bus1", "-device", "kvaser_pci,canbus=bus1", "-device", "kvaser_pci,canbus=bus1",
]  # fmt: skip


def main() -> int:
    """Exit status 0: every check was ok."""
    with (CACHE / "replayed").open("w") as here:  # what the board's values are compared with
        replay = [sys.executable, *REPLAY.split(), "--calibration", "tests/data/rings331_ball.json"]
        subprocess.run(replay, cwd=ROOT, stdout=here, check=True)
    begun_s = time.monotonic()
    lines: list[str] = []
    done = False
    with subprocess.Popen(
        COMMAND, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True, errors="replace"
    ) as board:
        assert board.stdout is not None
        for line in board.stdout:
            text = line.rstrip()
            at_s = time.monotonic() - begun_s
            text = text[max(0, text.find("CHECK ")) :]  # the console may hold a prompt before it
            print(f"{at_s:6.0f} {text}", flush=True)
            if text.startswith(("CHECK", "TIME", "SHOW", "BOARD", "    ")):
                lines.append(text)
            done |= text == "DONE"
            if done or at_s > LONGEST_S:
                board.kill()
                break
    checks = [line for line in lines if line.startswith("CHECK")]
    failed = [line for line in checks if not line.startswith("CHECK ok")]
    if not done:
        failed.append("CHECK FAIL the board did not come to the end")
    stamp = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    body = "\n".join(lines)
    (HERE / "RESULT.md").write_text(
        f"# Emulated board: last result\n\n`make sbc-test`, {stamp}, {time.monotonic() - begun_s:.0f} s from "
        f"power on: {len(checks)} checks, {len(failed)} failed.\n\n```\n{body}\n```\n"
    )
    print(f"{len(checks)} checks, {len(failed)} failed", *failed, sep="\n")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
