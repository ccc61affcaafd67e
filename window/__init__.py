"""The window of `vpltune view`: a page in the browser, drawn by the runtime."""
