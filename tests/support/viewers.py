"""Viewers of a live page: `python -m tests.support.viewers URL N SECONDS` for N of them."""

import asyncio
import math
import sys
import time

import aiohttp

from tests.support.waiting import SOON_S


async def look(url: str, packets_n: int = 2, until_s: float = math.inf) -> int:
    """A viewer connects, reads some packets (0: any number) or for some time; returns how many."""
    async with (
        asyncio.timeout(SOON_S if math.isinf(until_s) else None),
        aiohttp.ClientSession() as session,
        session.ws_connect(url, max_msg_size=0) as connection,
    ):
        await connection.send_json({"want": ["image"]})
        got_n = 0
        async for message in connection:
            if message.type is aiohttp.WSMsgType.BINARY:
                got_n += 1
                await connection.send_json({"got": got_n})
            if got_n == packets_n > 0 or time.monotonic() > until_s:
                break
        return got_n


async def _look_together(url: str, viewers_n: int, seconds: float) -> None:
    until_s = time.monotonic() + seconds
    await asyncio.gather(*(look(url, 0, until_s) for _ in range(viewers_n)))


if __name__ == "__main__":
    asyncio.run(_look_together(sys.argv[1], int(sys.argv[2]), float(sys.argv[3])))
