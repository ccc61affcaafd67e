"""An exported page: its text, and what is drawn in it."""

import base64
import dataclasses
import io

import numpy as np
from built_scenes import room_view
from exported_frames import CONFIG
from PIL import Image

from vpltune.renderer.export.scene_bundle import scene_bundle
from vpltune.renderer.export.web_page import web_page
from vpltune.renderer.scene.scene import Camera

SOFTWARE_GL = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")


def web_view(light, size=(96, 72)):
    """A view of the room in which no edge runs along a row or a column of pixel centres."""
    view = room_view(light, size)
    to_world = view.camera.to_world.copy()
    to_world[:3, 3] += 0.03, 0.0071, 0.0
    return dataclasses.replace(view, camera=Camera(to_world, view.camera.yfov))


def image_of(page):
    """The pixels of a page's image once it is complete, [height, width, 3]."""
    page.evaluate("vpltune.finished()")
    encoded = page.evaluate("document.getElementById('image').toDataURL('image/png')").split(",")[1]
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(encoded))).convert("RGB")).astype(int)


def page_text(scene, view, config=CONFIG):
    """The page of a scene in one view."""
    return web_page(scene_bundle(scene, view, config))
