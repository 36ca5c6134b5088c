"""Recordings: camera images, results of the stages, samples sent to the bus; one MCAP file.

    with Recorder("press.mcap") as recorder:            # edge.recording.writer
        recorder.frame(frame)
    for frame in RecordingSource("press.mcap"):         # edge.recording.reader

The file is plain MCAP with Foxglove's schemas, so that Foxglove, Lichtblick and PlotJuggler open it without a
plug-in. A truncated file can be read up to its last complete chunk.
"""
