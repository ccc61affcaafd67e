"""HTML reports: a page for each fit, and a page for a whole library.

Every page is self-contained. Its content security policy forbids network requests.
"""
