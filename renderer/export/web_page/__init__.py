"""A tuned scene as one web page that draws it: WebGL 2, everything inside, nothing fetched."""

from vpltune.renderer.export.web_page.web_page import web_page as web_page
