"""`python -m calib report`: the accuracy of calibrations and the reasons for the methods, as one page.

study      each design choice against its alternatives: time per frame, and error
plots      the pictures
page       the page
command    captures in, page out
"""
