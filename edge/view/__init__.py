"""The live page: camera, cells, contacts, shear and charts in a browser, on demand.

    page = Page(parse_listen("127.0.0.1:8765"), source, serial, commands, on_wants)
    page.start(); page.show(...); ...; page.close()

- It lives in a process of its own (`edge.aside`), which gets from the loop what is new; it makes what viewers
  see, at 30 Hz at most, and the browser draws it. While nobody watches, nothing is made or computed.
- Looking is free on this machine; tare and record need the token.
"""

from __future__ import annotations

from edge.view.live import Page

__all__ = ["Page"]
