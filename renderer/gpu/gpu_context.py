"""The OpenGL 4.5 context, headless through EGL, set up for reversed depth."""

import ctypes
from collections.abc import Callable

import moderngl

from vpltune.renderer.errors import MachineError

REQUIRED_VERSION = 450
"""OpenGL 4.5: compute shaders and storage buffers (4.3), glClipControl (4.5)."""

MOST_BINDINGS = 16
"""Most resources that one of our programs declares, rounded up; OpenGL 4.5 guarantees 8 storage buffers."""

# From gl.xml, the registry of OpenGL; moderngl has no names for them.
_GL_LOWER_LEFT = 0x8CA1
_GL_ZERO_TO_ONE = 0x935F
_GL_TEXTURE_2D = 0x0DE1
_GL_DEPTH_COMPONENT = 0x1902
_GL_DEPTH_COMPONENT32F = 0x8CAC
_GL_FLOAT = 0x1406

GL_SRGB8 = 0x8C41  # as above
GL_SRGB8_ALPHA8 = 0x8C43  # as above


def create_context() -> moderngl.Context:
    """A headless OpenGL 4.5 context, current on the calling thread.

    Depth runs from 1 at the near plane to 0 at infinity, in a 32-bit float buffer: with clip depth in
    [0, 1] the relative precision is then the same at every distance, so that no near or far plane has
    to be tuned to a scene's units.

    Raises:
        MachineError: no EGL device, an OpenGL older than 4.5, or too few bindings of storage buffers.
    """
    try:
        context = moderngl.create_context(standalone=True, backend="egl")  # pyright: ignore[reportArgumentType] their stub
    # moderngl raises bare Exception; glcontext raises whatever loading libEGL raised.
    except Exception as error:
        raise MachineError(
            f"no headless OpenGL context ({error}); try: apt-get install libegl1 libgl1 libgl1-mesa-dri"
        ) from error
    if context.version_code < REQUIRED_VERSION:
        version, name = context.version_code, context.info["GL_RENDERER"]
        context.release()
        raise MachineError(
            f"OpenGL {REQUIRED_VERSION} is needed, {name} offers {version}; run: vpltune doctor"
        )
    bindings = context.info["GL_MAX_SHADER_STORAGE_BUFFER_BINDINGS"]
    if bindings < MOST_BINDINGS:
        name = context.info["GL_RENDERER"]
        context.release()
        raise MachineError(f"{MOST_BINDINGS} storage buffers must be bound, {name} binds {bindings}")
    # "auto" would free objects from whichever thread drops them; ours wait for `free_dropped`.
    context.gc_mode = "context_gc"
    clip_control = _gl_function("glClipControl", None, ctypes.c_uint, ctypes.c_uint)
    clip_control(_GL_LOWER_LEFT, _GL_ZERO_TO_ONE)
    return context


def create_depth_texture(context: moderngl.Context, size: tuple[int, int]) -> moderngl.Texture:
    """A 32-bit float depth texture that shaders read as plain depth (moderngl's own has 24 bits)."""
    texture = context.depth_texture(size)
    texture.compare_func = ""
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    texture.repeat_x = texture.repeat_y = False
    texture.use(0)
    c_int, c_uint = ctypes.c_int, ctypes.c_uint
    tex_image = _gl_function(
        "glTexImage2D", None, c_uint, c_int, c_int, c_int, c_int, c_int, c_uint, c_uint, ctypes.c_void_p
    )
    tex_image(
        _GL_TEXTURE_2D, 0, _GL_DEPTH_COMPONENT32F, size[0], size[1], 0, _GL_DEPTH_COMPONENT, _GL_FLOAT, None
    )
    check_errors(context, f"a {size[0]}x{size[1]} depth texture")
    return texture


def free_dropped(context: moderngl.Context) -> None:
    """Free the OpenGL objects that nothing refers to any more.

    As `context.gc()`, which stops with an exception at an object that was also released by hand.
    """
    while context.objects:
        dropped = context.objects.popleft()
        if hasattr(dropped, "release"):
            dropped.release()


def check_errors(context: moderngl.Context, doing: str) -> None:
    """Raise MachineError if OpenGL has flagged an error: moderngl itself never looks, not even for memory."""
    error = context.error
    if error != "GL_NO_ERROR":
        raise MachineError(f"OpenGL reported {error} while making {doing} ({context.info['GL_RENDERER']})")


def _gl_function(name: str, result: type | None, *arguments: type) -> Callable[..., object]:
    """An OpenGL entry point that moderngl does not wrap."""
    egl = ctypes.CDLL("libEGL.so.1")
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    address = egl.eglGetProcAddress(name.encode())
    if not address:
        raise MachineError(f"this OpenGL driver has no {name}; run: vpltune doctor")
    return ctypes.CFUNCTYPE(result, *arguments)(address)
