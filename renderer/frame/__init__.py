"""One frame: its passes, and the runtime that draws with them."""
