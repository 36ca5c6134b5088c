"""`python -m calib report`: what a calibration can do and why it is built as it is, as one page.

study      each design choice against its alternatives: time per frame, and error
plots      the pictures
page       the page
command    captures in, page out
"""
