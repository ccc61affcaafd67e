"""Reports: one self-contained HTML page for a fit, and one for a library of them.

Everything a page shows lies within it; nothing is asked of any network, which the page itself forbids.
"""
