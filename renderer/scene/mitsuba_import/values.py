"""Numbers, vectors and colours in the attributes of Mitsuba's XML."""

import re

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.files.srgb import linear_from_srgb
from vpltune.renderer.scene.files.diagnostics import SceneFileError
from vpltune.renderer.scene.files.plain_numbers import plain_number
from vpltune.renderer.scene.mitsuba_import.xml_tree import XmlNode

# A choice: wavelength bands in nm over which a sampled spectrum is averaged, for red, green and blue.
_BANDS = ((580.0, 680.0), (490.0, 580.0), (420.0, 490.0))


def attribute(node: XmlNode, key: str) -> str:
    """The text of a required attribute.

    Raises:
        SceneFileError: the attribute is missing.
    """
    if key not in node.attributes:
        raise SceneFileError(f"{node.where}: attribute '{key}' is missing")
    return node.attributes[key]


def numbers(node: XmlNode, key: str, count: int) -> Float64[np.ndarray, " count"]:
    """`count` numbers from an attribute, separated by spaces or commas.

    Raises:
        SceneFileError: the attribute is missing, the count differs, or a number is not finite.
    """
    words = attribute(node, key).replace(",", " ").split()
    try:
        found = [plain_number(word) for word in words]
    except ValueError:
        found = []
    if len(found) != count:
        plural = "s" * (count > 1)
        raise SceneFileError(
            f"{node.where}: {key} must be {count} finite number{plural}, got {node.attributes[key]!r:.60}"
        )
    return np.array(found, np.float64)


def vector(node: XmlNode, absent: float) -> Float64[np.ndarray, "3"]:
    """Three numbers: from `value` (three, or one for all), or from `x`, `y` and `z`, by default `absent`.

    Raises:
        SceneFileError: a number cannot be read or is not finite.
    """
    if "value" in node.attributes:
        count = len(node.attributes["value"].replace(",", " ").split())
        return np.broadcast_to(numbers(node, "value", 1 if count == 1 else 3), 3).copy()
    return np.array([numbers(node, axis, 1)[0] if axis in node.attributes else absent for axis in "xyz"])


def color(node: XmlNode) -> Float64[np.ndarray, "3"]:
    """The linear RGB colour of an <rgb>, <srgb> or <spectrum> element, or of a #rrggbb value.

    Raises:
        SceneFileError: the colour cannot be read or is negative.
    """
    text = attribute(node, "value").strip()
    if re.fullmatch(r"#[0-9a-fA-F]{6}", text):
        encoded = np.array([int(text[i : i + 2], 16) / 255.0 for i in (1, 3, 5)])
        return linear_from_srgb(encoded)
    if node.tag == "spectrum" and ":" in text:
        found = _sampled_spectrum(node, text)
    else:
        count = len(text.replace(",", " ").split())
        found = np.broadcast_to(numbers(node, "value", 1 if count == 1 else 3), 3).copy()
    if (found < 0.0).any():
        raise SceneFileError(f"{node.where}: a colour must not be negative, got {text!r:.60}")
    return linear_from_srgb(found) if node.tag == "srgb" else found


def _sampled_spectrum(node: XmlNode, text: str) -> Float64[np.ndarray, "3"]:
    try:
        found = [[plain_number(part) for part in word.split(":")] for word in text.replace(",", " ").split()]
    except ValueError:
        found = []
    if not found or any(len(pair) != 2 for pair in found):
        raise SceneFileError(f"{node.where}: a spectrum must be wavelength:value pairs, got {text!r:.60}")
    pairs = np.array(found)
    pairs = pairs[np.argsort(pairs[:, 0], kind="stable")]
    return np.array([np.interp(np.linspace(*band, 16), pairs[:, 0], pairs[:, 1]).mean() for band in _BANDS])


def unit_direction(vector: Float64[np.ndarray, "3"], where: str) -> Float64[np.ndarray, "3"]:
    """The vector scaled to unit length; `where` is named in the error.

    Raises:
        SceneFileError: the vector is zero.
    """
    length = float(np.linalg.norm(vector))
    if not length > 0.0:
        raise SceneFileError(f"{where}: its direction must not be zero")
    return vector / length
