"""Viewers and recorder in their own process, beside the loop.

    loop's process                                      second process (`python -m edge.worker`)
    loop --after the sample has left--> Outbox ==memory==> Inbox --> LivePage --> browsers
                                                               \\--> Recorder --> file
    commands, viewers' requests      <----- control socket -----

Pictures, packets, protobuf and the web server are Python, and would delay the loop in its own process. The
loop never waits, and sends only while somebody watches or a recording is made. Either process may die.
"""
