"""Mitsuba's XML as a tree of plugins: names of either version, defaults put in, references followed."""

import re
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from vpltune.renderer.scene.files.diagnostics import SceneFileError, label
from vpltune.renderer.scene.mitsuba_import.transforms import Matrix, transform
from vpltune.renderer.scene.mitsuba_import.values import attribute, color, numbers, vector
from vpltune.renderer.scene.mitsuba_import.xml_tree import XmlNode

_OBJECTS = frozenset(
    (
        "bsdf", "emitter", "film", "integrator", "medium", "phase", "rfilter", "sampler", "scene", "sensor",
        "shape", "subsurface", "texture", "volume",
    )
)  # fmt: skip
Value = float | bool | str | np.ndarray
V = TypeVar("V")


@dataclass(eq=False)
class Plugin:
    """One object of the scene."""

    kind: str
    """Its tag: shape, bsdf, emitter …"""
    type: str
    where: str
    values: dict[str, Value] = field(default_factory=dict)
    """Numbers, flags, texts, vectors and colours (3), transforms (4 × 4), by snake_case name."""
    children: list[tuple[str, "Plugin"]] = field(default_factory=list)
    """Objects within or referred to, each with the name it has here, or an empty one."""

    def number(self, name: str, absent: float) -> float:
        return float(self._value(name, float, "a number", absent))

    def flag(self, name: str, absent: bool) -> bool:
        return self._value(name, bool, "a boolean", absent)

    def text(self, name: str, absent: str | None = None) -> str:
        """Raises SceneFileError where it is missing and nothing stands in for it."""
        if absent is None and name not in self.values:
            raise SceneFileError(f"{self.where}: '{name}' is missing")
        return self._value(name, str, "a string", absent or "")

    def vector(self, name: str, absent: tuple[float, float, float]) -> np.ndarray:
        value = self._value(name, object, "", np.array(absent))
        if isinstance(value, float):
            return np.full(3, value)
        if not isinstance(value, np.ndarray) or value.shape != (3,):
            raise SceneFileError(f"{self.where}: '{name}' must be three numbers or one")
        return value

    def to_world(self, name: str = "to_world") -> Matrix:
        value = self._value(name, object, "", np.eye(4))
        if not isinstance(value, np.ndarray) or value.shape != (4, 4):
            raise SceneFileError(f"{self.where}: '{name}' must be a transform")
        return value

    def child(self, *names: str) -> "Plugin | None":
        """The first object here under one of `names`."""
        return next((plugin for name, plugin in self.children if name in names), None)

    def of_kind(self, kind: str) -> "list[Plugin]":
        return [plugin for _, plugin in self.children if plugin.kind == kind]

    def _value(self, name: str, kind: type[V], expected: str, absent: V) -> V:
        value = self.values.get(name, absent)
        if not isinstance(value, kind):
            raise SceneFileError(f"{self.where}: '{name}' must be {expected}")
        return value


def plugin_tree(root: XmlNode) -> Plugin:
    """The scene that the document describes.

    Raises:
        SceneFileError: an element is unknown, lacks an attribute or has a bad value, or a name is unknown.
    """
    if root.tag != "scene":
        raise SceneFileError(f"{root.where}: a Mitsuba scene's outermost element is <scene>")
    return _Reader().plugin(root)


class _Reader:
    def __init__(self) -> None:
        self._defaults: dict[str, str] = {}
        self._named: dict[str, Plugin] = {}

    def plugin(self, node: XmlNode) -> Plugin:
        kind = label(attribute(node, "type"), "?") if node.tag != "scene" else "scene"
        made = Plugin(node.tag, kind, f"line {node.line}: {node.tag} '{kind}'")
        for child in node.children:
            self._put_in(child)
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
        elif tag in _OBJECTS:
            made.children.append((_snake_case(child.attributes.get("name", "")), self.plugin(child)))
        else:
            made.values[_snake_case(attribute(child, "name"))] = _value(child)

    def _referred(self, node: XmlNode, name: str) -> Plugin:
        if name not in self._named:
            raise SceneFileError(f"{node.where}: nothing before it has the id {name!r:.60}")
        return self._named[name]

    def _put_in(self, node: XmlNode) -> None:
        """Put defaults in place of their $names, here and in a transform's steps."""
        for key, text in node.attributes.items():
            for name in re.findall(r"\$(\w+)", text):
                if name not in self._defaults:
                    raise SceneFileError(f"{node.where}: {key}: ${name:.60} has no <default>")
                text = text.replace(f"${name}", self._defaults[name])
            node.attributes[key] = text
        if node.tag == "transform":
            for step in node.children:
                self._put_in(step)


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
            raise SceneFileError(f"{node.where}: temperatures are not read; give an <rgb>")
    raise SceneFileError(f"{node.where}: such an element is not known here")


def _snake_case(name: str) -> str:
    """Names of version 0.x in the form of version 2 and later: toWorld is to_world."""
    return re.sub(r"(?<=[a-z0-9])([A-Z])", lambda match: "_" + match.group(1).lower(), name)
