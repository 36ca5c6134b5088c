"""Pictures and the live page: camera, cells, contacts, shear and charts.

    palette, panels   one picture as in the paper, drawn with OpenCV: live view, video
    figures           the same with matplotlib, for print; extra `plot`
    video             pictures -> a video file
    page, scene       the live page, served by the worker process (`edge.worker`), drawn by the browser

- Everything takes the types that flow between the stages; polygons come from the tessellation.
- While nobody watches, nothing is made or computed.
- Looking is free on this machine; tare and record need the token.
"""
