"""Pictures and video of a frame as in the paper, figures for print, and the data of the live page."""
