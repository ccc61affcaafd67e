"""Mitsuba's XML as a tree of plugins: defaults substituted, references resolved, names in snake_case."""

import builtins
import re
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from vpltune.renderer.scene.files.diagnostics import SceneFileError, label
from vpltune.renderer.scene.mitsuba_import.transforms import Matrix, transform
from vpltune.renderer.scene.mitsuba_import.values import attribute, color, numbers, vector
from vpltune.renderer.scene.mitsuba_import.xml_tree import XmlNode

# Tags of elements that are plugins; all others are values or declarations.
_OBJECTS = frozenset(
    (
        "bsdf", "emitter", "film", "integrator", "medium", "phase", "rfilter", "sampler", "scene", "sensor",
        "shape", "subsurface", "texture", "volume",
    )
)  # fmt: skip
# A choice: most characters of an attribute once its defaults are put in, and of all these together.
# Defaults may hold other defaults, so that a kilobyte can ask for a terabyte.
_LONGEST_VALUE, _LONGEST_TOGETHER = 1 << 16, 1 << 24
Value = float | bool | str | np.ndarray
V = TypeVar("V")
"""Type of a plugin's value."""


@dataclass(eq=False)
class Plugin:
    """A Mitsuba plugin with its values and children.

    The getters return a value by its snake_case name, or `absent` if it is not given. They raise
    SceneFileError if the value has another type.
    """

    kind: str
    """The tag: shape, bsdf, emitter …"""
    type: str
    """The attribute `type`: sphere, diffuse, area …"""
    where: str
    """Line, tag and type, for messages."""
    values: dict[str, Value] = field(default_factory=dict)
    """Numbers, booleans, strings, vectors and colours [3] and transforms [4, 4], by snake_case name."""
    children: list[tuple[str, "Plugin"]] = field(default_factory=list)
    """Nested or referenced plugins, each with its snake_case name, or an empty one."""
    search_paths: list[tuple[str, str]] = field(default_factory=list)
    """The folders of a scene's <path> elements, each with its line and tag."""
    version: str = ""
    """The scene's version of Mitsuba, or an empty text."""

    def number(self, name: str, absent: float) -> float:
        """A number."""
        return float(self._value(name, float, "a number", absent))

    def flag(self, name: str, absent: bool) -> bool:
        """A boolean."""
        return self._value(name, bool, "a boolean", absent)

    def text(self, name: str, absent: str | None = None) -> str:
        """A string. It is required if `absent` is None.

        Raises:
            SceneFileError: the string is missing and required, or the value has another type.
        """
        if absent is None and name not in self.values:
            raise SceneFileError(f"{self.where}: '{name}' is missing")
        return self._value(name, str, "a string", absent or "")

    def vector(self, name: str, absent: tuple[float, float, float]) -> np.ndarray:
        """Three numbers [3]: a point, vector or colour. A single number counts for all three."""
        value = self._value(name, object, "", np.array(absent))
        if isinstance(value, float):
            return np.full(3, value)
        if not isinstance(value, np.ndarray) or value.shape != (3,):
            raise SceneFileError(f"{self.where}: '{name}' must be one number or three")
        return value

    def to_world(self, name: str = "to_world") -> Matrix:
        """A transform [4, 4], the identity if it is not given."""
        value = self._value(name, object, "", np.eye(4))
        if not isinstance(value, np.ndarray) or value.shape != (4, 4):
            raise SceneFileError(f"{self.where}: '{name}' must be a transform")
        return value

    def child(self, *names: str) -> "Plugin | None":
        """The first child with one of `names`, or None."""
        return next((plugin for name, plugin in self.children if name in names), None)

    def of_kind(self, kind: str) -> "list[Plugin]":
        """All children of a kind, in document order."""
        return [plugin for _, plugin in self.children if plugin.kind == kind]

    # `type` is a field of the plugin here.
    def _value(self, name: str, kind: builtins.type[V], expected: str, absent: V) -> V:
        value = self.values.get(name, absent)
        if not isinstance(value, kind):
            raise SceneFileError(f"{self.where}: '{name}' must be {expected}")
        return value


def plugin_tree(root: XmlNode) -> Plugin:
    """The plugin of the root element <scene>, with everything below it.

    Raises:
        SceneFileError: an element is unknown, lacks an attribute or has an invalid value, or a reference or a
            default is undefined.
    """
    if root.tag != "scene":
        raise SceneFileError(f"{root.where}: the root element of a Mitsuba scene must be <scene>")
    scene = _Reader().plugin(root)
    scene.version = root.attributes.get("version", "").strip()
    return scene


class _Reader:
    def __init__(self) -> None:
        self._defaults: dict[str, str] = {}
        self._named: dict[str, Plugin] = {}
        self._left = _LONGEST_TOGETHER

    def plugin(self, node: XmlNode) -> Plugin:
        kind = label(attribute(node, "type"), "?") if node.tag != "scene" else "scene"
        made = Plugin(node.tag, kind, f"line {node.line}: {node.tag} '{kind}'")
        for child in node.children:
            self._substitute_defaults(child)
            self._read_into(made, child)
        if "id" in node.attributes:
            self._named[node.attributes["id"]] = made
        return made

    def _read_into(self, made: Plugin, child: XmlNode) -> None:
        tag = child.tag
        if tag == "default":
            self._defaults.setdefault(attribute(child, "name"), attribute(child, "value"))
        elif tag == "alias":
            self._named[attribute(child, "as")] = self._referred(child, attribute(child, "id"))
        elif tag == "ref":
            name = child.attributes.get("name", "")
            made.children.append((_snake_case(name), self._referred(child, attribute(child, "id"))))
        elif tag == "path" and made.kind == "scene":
            made.search_paths.append((attribute(child, "value"), child.where))
        elif tag in _OBJECTS:
            made.children.append((_snake_case(child.attributes.get("name", "")), self.plugin(child)))
        else:
            made.values[_snake_case(attribute(child, "name"))] = _value(child)

    def _referred(self, node: XmlNode, name: str) -> Plugin:
        if name not in self._named:
            raise SceneFileError(f"{node.where}: no object with the id {name!r:.60} is defined before it")
        return self._named[name]

    def _substitute_defaults(self, node: XmlNode) -> None:
        """Replace each $name by its default, in the attributes of a node and of a transform's steps."""
        for key, text in node.attributes.items():
            if "$" in text:
                node.attributes[key] = self._with_defaults(text, f"{node.where}: {key}")
        if node.tag == "transform":
            for step in node.children:
                self._substitute_defaults(step)

    def _with_defaults(self, text: str, where: str) -> str:
        # Every second part is a name.
        parts = re.split(r"\$(\w+)", text)
        for i in range(1, len(parts), 2):
            if parts[i] not in self._defaults:
                raise SceneFileError(f"{where}: ${parts[i]:.60} has no <default>")
            parts[i] = self._defaults[parts[i]]
        length = sum(map(len, parts))
        self._left -= length
        if length > _LONGEST_VALUE or self._left < 0:
            raise SceneFileError(
                f"{where}: with its defaults, it must have at most {_LONGEST_VALUE:,} characters, "
                f"and all together {_LONGEST_TOGETHER:,}"
            )
        return "".join(parts)


def _value(node: XmlNode) -> Value:
    match node.tag:
        case "float" | "integer":
            return float(numbers(node, "value", 1)[0])
        case "boolean":
            text = attribute(node, "value").strip().lower()
            if text not in ("true", "false"):
                raise SceneFileError(f"{node.where}: value must be true or false, got {text!r:.60}")
            return text == "true"
        case "string":
            return attribute(node, "value")
        case "rgb" | "srgb" | "spectrum":
            return color(node)
        case "point" | "vector":
            return vector(node, 0.0)
        case "transform":
            return transform(node)
        case "blackbody":
            raise SceneFileError(f"{node.where}: blackbody temperatures are not supported; use an <rgb>")
    raise SceneFileError(f"{node.where}: unknown element")


def _snake_case(name: str) -> str:
    """Names from version 0.x as version 2 and later write them: toWorld becomes to_world."""
    return re.sub(r"(?<=[a-z0-9])([A-Z])", lambda match: "_" + match.group(1).lower(), name)
