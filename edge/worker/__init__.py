"""Viewers and recorder in their own process, beside the loop.

    worker = WorkerClient(loop, WorkerConfig(parse_listen("127.0.0.1:8765"), Path("touch.mcap")))
    worker.start(); loop.run(); worker.close()

    loop's process                                      second process (`python -m edge.worker`)
    loop --after the sample has left--> Outbox ==memory==> Inbox --> LivePage --> browsers
                                                               \\--> Recorder --> file
    commands, viewers' requests      <----- control socket -----

- Pictures, packets, protobuf and the web server are Python, and one interpreter runs one thread at a time:
  in the loop's process each of them would delay the loop.
- The loop copies a result into shared memory, never waits, and does so only while somebody watches or a
  recording is made.
- Either process may die: the loop reports it and goes on; the second process writes what it has received, and
ends.
"""

from __future__ import annotations

from edge.worker.client import WorkerClient, WorkerConfig

__all__ = ["WorkerClient", "WorkerConfig"]
