"""Named buffers and textures, and the memory barriers between those who write them and those who read them.

OpenGL orders most work by itself, but not what shaders write through storage buffers and images (OpenGL 4.6
core, 7.13.2): a later access sees it only after a barrier for that kind of access. `Resources` knows what was
accessed since the last barrier of each kind, and places the barriers that are needed and no others.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import moderngl

Resource = moderngl.Buffer | moderngl.Texture

SAMPLED = moderngl.Context.TEXTURE_FETCH_BARRIER_BIT
IMAGE = moderngl.Context.SHADER_IMAGE_ACCESS_BARRIER_BIT
STORAGE = moderngl.Context.SHADER_STORAGE_BARRIER_BIT
COMMANDS = moderngl.Context.COMMAND_BARRIER_BIT
HOST_BUFFER = moderngl.Context.BUFFER_UPDATE_BARRIER_BIT
HOST_TEXTURE = moderngl.Context.TEXTURE_UPDATE_BARRIER_BIT
_ALL = SAMPLED | IMAGE | STORAGE | COMMANDS | HOST_BUFFER | HOST_TEXTURE


@dataclass(frozen=True)
class Access:
    """One way in which a command uses a resource."""

    name: str
    kind: int
    """`SAMPLED`, `IMAGE`, `STORAGE`, `COMMANDS`, `HOST_BUFFER` or `HOST_TEXTURE`."""
    writes: bool = False
    """Whether a shader writes, through a storage buffer or an image."""


class _Entry:
    """A resource, and the kinds of barriers that are missing since its last uses."""

    def __init__(self, resource: Resource):
        self.resource = resource
        # Nothing is known of what happened before, so the first use of each kind gets its barrier.
        self.unseen = _ALL
        """Kinds of access that would miss what a shader wrote."""
        self.unordered = _ALL
        """Kinds of shader write that could overtake an earlier use."""


class Resources:
    """Buffers and textures by name. A child sees its parent's too, and may put its own in their place.

    Example:
        >>> resources = Resources(context)
        >>> resources["exposure"] = context.buffer(reserve=16)
        >>> resources.buffer("exposure").size
        16
    """

    def __init__(self, context: moderngl.Context, parent: "Resources | None" = None):
        self.context = context
        self._parent = parent
        self._entries: dict[str, _Entry] = {}

    def __setitem__(self, name: str, resource: Resource) -> None:
        known = self._entries.get(name)
        if known is None or known.resource is not resource:
            self._entries[name] = _Entry(resource)

    def __getitem__(self, name: str) -> Resource:
        return self._entry(name).resource

    def __contains__(self, name: str) -> bool:
        return name in self._entries or (self._parent is not None and name in self._parent)

    def buffer(self, name: str) -> moderngl.Buffer:
        """The buffer called `name`.

        Raises:
            KeyError: there is none.
        """
        resource = self[name]
        if not isinstance(resource, moderngl.Buffer):
            raise KeyError(f"resource '{name}' is no buffer")
        return resource

    def texture(self, name: str) -> moderngl.Texture:
        """The texture called `name`.

        Raises:
            KeyError: there is none.
        """
        resource = self[name]
        if not isinstance(resource, moderngl.Texture):
            raise KeyError(f"resource '{name}' is no texture")
        return resource

    def alias(self, name: str, other: str) -> None:
        """Make `name` the same resource as `other`."""
        self._entries[name] = self._entry(other)

    def child(self) -> "Resources":
        """Resources that fall back on these."""
        return Resources(self.context, self)

    def write(self, name: str, content: bytes) -> None:
        """Write a buffer from the CPU, ordered after what shaders wrote."""
        self.access((Access(name, HOST_BUFFER),))
        self.buffer(name).write(content)

    def copy(self, source: str, target: str, start: int = 0) -> None:
        """Fill the buffer `target` from byte `start` on with the buffer `source`, as far as both reach."""
        self.access((Access(source, HOST_BUFFER), Access(target, HOST_BUFFER)))
        into, content = self.buffer(target), self.buffer(source)
        size = min(into.size - start, content.size)
        self.context.copy_buffer(into, content, size=size, write_offset=start)

    def read(self, name: str, size: int = -1) -> bytes:
        """Read a buffer back, from its start: waits for the GPU."""
        self.access((Access(name, HOST_BUFFER),))
        return self.buffer(name).read(size)

    def access(self, accesses: Iterable[Access]) -> None:
        """Place the barrier that these accesses of one command need, and remember them."""
        entries = [(self._entry(access.name), access) for access in accesses]
        missing = 0
        for entry, access in entries:
            missing |= access.kind & (entry.unseen | (entry.unordered if access.writes else 0))
        if missing:
            self.context.memory_barrier(missing)
            self._passed(missing)
        for entry, access in entries:
            entry.unordered = _ALL
            if access.writes:
                entry.unseen = _ALL

    def _passed(self, kinds: int) -> None:
        for entry in self._entries.values():
            entry.unseen &= ~kinds
            entry.unordered &= ~kinds
        if self._parent is not None:
            self._parent._passed(kinds)

    def _entry(self, name: str) -> _Entry:
        if name in self._entries:
            return self._entries[name]
        if self._parent is None:
            raise KeyError(f"there is no resource called '{name}'")
        return self._parent._entry(name)
