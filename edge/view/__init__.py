"""The live page: camera, cells, contacts, shear and charts in a browser, on demand.

    view = View(app, parse_listen("127.0.0.1:8765"))
    app.watchers.append(view.watch); view.start(); ...; view.close()

- The loop hands over references and goes on; the server's thread makes what viewers see, at 30 Hz at most,
  and the browser draws it. While nobody watches, nothing is made and nothing more is computed.
- Looking is free on this machine; tare and record need the token.
"""

from __future__ import annotations

from edge.view.live import View

__all__ = ["View"]
