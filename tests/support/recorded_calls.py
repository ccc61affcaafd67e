"""Contexts and buffers that do nothing and say what they were asked to."""

import moderngl


class RecordingContext(moderngl.Context):
    """Keeps every memory barrier and copy; there is no OpenGL behind it."""

    def __init__(self):
        self.barriers: list[int] = []
        self.calls: list[str] = []

    def memory_barrier(self, barriers: int = moderngl.Context.ALL_BARRIER_BITS, by_region: bool = False):
        self.barriers.append(barriers)
        self.calls.append("barrier")

    def copy_buffer(self, dst, src, size=-1, *, read_offset=0, write_offset=0):
        self.calls.append(f"copy {size}")

    def taken(self) -> list[int]:
        """The barriers since this was last asked."""
        barriers, self.barriers = self.barriers, []
        return barriers


class RecordingBuffer(moderngl.Buffer):
    """A buffer of zeros."""

    def __init__(self, context: RecordingContext, size: int = 16):
        self.context = context
        self._bytes = size

    def __del__(self):
        pass

    @property
    def size(self):
        return self._bytes

    def write(self, data, offset=0):
        self.context.calls.append("write")

    def read(self, size=-1, offset=0):
        self.context.calls.append("read")
        return bytes(self._bytes if size < 0 else size)
