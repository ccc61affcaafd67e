"""What a clip carries from one frame to the next."""

import moderngl


class ClipState:
    """Discs, their importance, and the eased parameters of an `auto` config. Make one for each clip.

    All of it is on the GPU. Lloyd iterations start from the discs of the frame before, and importance stays
    while it is near that of this frame. Both flicker less.

    It stays with the OpenGL context that it was first drawn on.

    Example:
        >>> state = ClipState()
        >>> for view in views:
        ...     image = runtime.render(view, config, state)
    """

    def __init__(self) -> None:
        self._buffers: dict[str, moderngl.Buffer] = {}

    def buffer(self, context: moderngl.Context, name: str, size: int) -> moderngl.Buffer:
        """The buffer called `name` of `size` bytes, zero before its first use.

        Raises:
            ValueError: it is of another context.
        """
        if name not in self._buffers:
            self._buffers[name] = context.buffer(bytes(size))
        if self._buffers[name].ctx is not context:
            raise ValueError("state: a clip is drawn on one OpenGL context, and this is another")
        return self._buffers[name]
