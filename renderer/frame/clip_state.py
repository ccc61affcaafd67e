"""What a clip carries from one frame to the next."""

import moderngl

from vpltune.renderer.scene.light_faces import LightRecords


class ClipState:
    """Discs, their importance, and the eased parameters of an `auto` config. Make one for each clip.

    All but the lights' records is on the GPU. Lloyd iterations start from the discs of the frame before.
    Importance stays while no light moves and it is near that of this frame. Both flicker less.

    It stays with the OpenGL context that it was first drawn on.

    Example:
        >>> state = ClipState()
        >>> for view in views:
        ...     image = runtime.render(view, config, state)
    """

    def __init__(self) -> None:
        self._buffers: dict[str, moderngl.Buffer] = {}
        self._lights = b""

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

    def lights_stand_still(self, records: LightRecords) -> bool:
        """Whether all lights are those of the call before, to the last bit; False at first.

        The finer faces of a sun go with the eye, by whole texels. Their light stands still all the same.
        """
        before, self._lights = self._lights, records.lights.tobytes()
        return before == self._lights
