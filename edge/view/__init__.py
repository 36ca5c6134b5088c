"""Pictures and the live page: camera, cells, contacts, shear and charts.

    palette, panels   one picture as in the paper, drawn with OpenCV: live view, video
    figures           the same with matplotlib, for print; extra `plot`
    video             pictures -> a video file
    page, scene       the live page, served by the worker process (`edge.worker`), drawn by the browser

- All functions take the types that flow between the stages; polygons come from the tessellation.
- While nobody watches, nothing is drawn or computed.
- Watching is free on this machine; tare and recording need the token.
"""
