"""A safe XML parser: document types are rejected, so there are no entities to expand and nothing to fetch."""

import xml.parsers.expat
from dataclasses import dataclass, field

from vpltune.renderer.scene.files.diagnostics import SceneFileError, label

# A choice: most elements of a document, far above those of real scenes. Each takes up to 1.5 kB.
_MOST_NODES = 500_000
# A choice: deepest nesting of elements, far above that of real scenes.
_DEEPEST = 64


@dataclass(eq=False, slots=True)
class XmlNode:
    """An XML element. Its text is dropped, since Mitsuba's elements have none."""

    tag: str
    attributes: dict[str, str]
    line: int
    children: list["XmlNode"] = field(default_factory=list)

    @property
    def where(self) -> str:
        """Line and tag, for messages."""
        return f"line {self.line}: <{label(self.tag, '?')}>"


def parse_xml(content: bytes) -> XmlNode:
    """The root element of a document.

    Raises:
        SceneFileError: the document is not well-formed XML, declares a document type, has too many elements
            or nests them too deep.
    """
    builder = _TreeBuilder()
    try:
        builder.parser.Parse(content, True)
    except xml.parsers.expat.ExpatError as error:
        raise SceneFileError(f"not XML ({error})") from error
    except (LookupError, ValueError) as error:  # an encoding that Python does not know
        raise SceneFileError(f"not XML ({error})") from error
    assert builder.root is not None, "expat accepts no document without a root"
    return builder.root


class _TreeBuilder:
    def __init__(self) -> None:
        self.root: XmlNode | None = None
        self._open: list[XmlNode] = []
        self._count = 0
        self.parser = xml.parsers.expat.ParserCreate()
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.StartDoctypeDeclHandler = self._refuse_doctype

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        node = XmlNode(tag, attributes, self.parser.CurrentLineNumber)
        self._count += 1
        if self._count > _MOST_NODES:
            raise SceneFileError(f"{node.where}: a scene must have at most {_MOST_NODES:,} elements")
        if len(self._open) >= _DEEPEST:
            raise SceneFileError(f"{node.where}: elements must be nested at most {_DEEPEST} deep")
        if self._open:
            self._open[-1].children.append(node)
        else:
            self.root = node
        self._open.append(node)

    def _end(self, tag: str) -> None:
        self._open.pop()

    def _refuse_doctype(self, name: str, *_: object) -> None:
        line = self.parser.CurrentLineNumber
        raise SceneFileError(
            f"line {line}: <!DOCTYPE {label(name, '?')}>: a scene must not declare a document type"
        )
