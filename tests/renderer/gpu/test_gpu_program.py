"""GPU programs: what they declare is what their shaders use, and is bound where the shaders look for it."""

import moderngl
import numpy as np
import pytest
from built_scenes import ROOM_LIGHTS, colored_room, room_view
from made_priors import made_prior
from point_vpls import point_vpls

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.frame.runtime_options import RuntimeOptions
from vpltune.renderer.gpu import gpu_program, shader_library
from vpltune.renderer.gpu.gpu_context import MOST_BINDINGS, create_context
from vpltune.renderer.gpu.gpu_program import ComputeProgram, RasterProgram
from vpltune.renderer.gpu.resources import IMAGE, SAMPLED, STORAGE, Resources
from vpltune.renderer.gpu.shader_library import ShaderError
from vpltune.renderer.scene.dynamic_lights import DynamicLights, point_lights
from vpltune.renderer.scene.views import View

HEAD = "layout(local_size_x = 1) in;\n"
GIVEN = "layout(std430, binding = GIVEN_BINDING) readonly buffer Given { int given[]; };\n"
FOUND = "layout(std430, binding = FOUND_BINDING) buffer Found { int found[]; };\n"
SHOWN = "layout(rgba32f, binding = SHOWN_IMAGE) writeonly uniform image2D out_shown;\n"
SEEN = "uniform sampler2D seen;\n"
OTHER = "layout(std430, binding = OTHER_BINDING) buffer Other { int other[]; };\n"

DOUBLE = HEAD + GIVEN + FOUND + "void main() { uint i = gl_GlobalInvocationID.x; found[i] = 2 * given[i]; }\n"
SHOW = HEAD + GIVEN + SHOWN + "void main() { imageStore(out_shown, ivec2(0), vec4(given[0])); }\n"
SAMPLE = HEAD + SEEN + FOUND + "void main() { found[0] = int(texelFetch(seen, ivec2(0), 0).x); }\n"


@pytest.fixture
def shaders(monkeypatch):
    """Shader texts by file name, in the place of those of the package."""
    texts: dict[str, str] = {}

    def read(name: str) -> str:
        if name not in texts:
            raise ShaderError(f"shaders/{name}: cannot be read (there is none)")
        return texts[name]

    monkeypatch.setattr(shader_library, "read_shader", read)
    return texts


@pytest.fixture
def resources(gl_context) -> Resources:
    resources = Resources(gl_context)
    resources["given"] = gl_context.buffer(np.arange(1, 5, dtype=np.int32))
    resources["found"] = gl_context.buffer(bytes(16))
    resources["seen"] = gl_context.texture((1, 1), 4, np.full(4, 7.0, np.float32), dtype="f4")
    resources["shown"] = gl_context.texture((1, 1), 4, bytes(16), dtype="f4")
    return resources


@pytest.fixture
def barriers(gl_context, monkeypatch) -> list[int]:
    """Every barrier that is placed on any context."""
    placed = []
    original = moderngl.Context.memory_barrier

    def barrier(self, barriers=moderngl.Context.ALL_BARRIER_BITS, by_region=False):
        placed.append(barriers)
        original(self, barriers, by_region)

    monkeypatch.setattr(moderngl.Context, "memory_barrier", barrier)
    return placed


def integers(resources: Resources, name: str = "found") -> list[int]:
    return np.frombuffer(resources.read(name), np.int32).tolist()


def test_buffers_are_read_and_written_where_the_shader_looks(resources, shaders):
    shaders["double.comp"] = DOUBLE
    ComputeProgram(resources, "double", reads=("given",), writes=("found",)).dispatch(4)
    assert integers(resources) == [2, 4, 6, 8]


def test_textures_are_sampled_and_stored(resources, shaders, gl_context):
    shaders |= {"show.comp": SHOW, "sample.comp": SAMPLE}
    ComputeProgram(resources, "show", reads=("given",), writes=("shown",)).dispatch(1)
    program = ComputeProgram(resources, "sample", reads=("shown as seen",), writes=("found",))
    program.dispatch(1)
    assert integers(resources) == [1, 0, 0, 0]
    ComputeProgram(resources, "sample", reads=("seen",), writes=("found",)).dispatch(1)
    assert integers(resources)[0] == 7


def test_another_name_for_the_shader(resources, shaders, gl_context):
    resources["numbers"] = gl_context.buffer(np.full(4, 5, np.int32))
    shaders["double.comp"] = DOUBLE
    program = ComputeProgram(resources, "double", reads=("numbers as given",), writes=("given as found",))
    program.dispatch(4)
    assert integers(resources, "given") == [10, 10, 10, 10]
    assert integers(resources, "found") == [0, 0, 0, 0]


def test_names_are_looked_up_at_every_dispatch(resources, shaders, gl_context):
    """Another buffer under the same name is taken from then on, and so is another alias."""
    shaders["double.comp"] = DOUBLE
    program = ComputeProgram(resources, "double", reads=("given",), writes=("found",))
    program.dispatch(4)
    resources["given"] = gl_context.buffer(np.full(4, 8, np.int32))
    program.dispatch(4)
    assert integers(resources) == [16] * 4
    resources["other"] = gl_context.buffer(bytes(16))
    resources.alias("found", "other")
    program.dispatch(2)
    assert integers(resources, "other") == [16, 16, 0, 0]


def test_a_program_of_a_childs_resources_uses_the_childs(resources, shaders, gl_context):
    shaders["double.comp"] = DOUBLE
    child = resources.child()
    child["found"] = gl_context.buffer(bytes(16))
    ComputeProgram(child, "double", reads=("given",), writes=("found",)).dispatch(4)
    assert integers(child) == [2, 4, 6, 8]
    assert integers(resources) == [0, 0, 0, 0]


def test_uniforms_and_defines(resources, shaders):
    """A uniform that the shader lacks is passed over."""
    shaders["scale.comp"] = (
        HEAD + FOUND + "uniform int factor;\nvoid main() { found[0] = factor * FACTOR + found[1]; }\n"
    )
    program = ComputeProgram(resources, "scale", {"FACTOR": 10}, writes=("found",))
    program.dispatch(1, factor=3, absent=5)
    assert integers(resources)[0] == 30


def test_an_indirect_dispatch_runs_as_many_groups_as_the_buffer_says(resources, shaders, barriers):
    """And waits for those who wrote the number."""
    shaders |= {
        "count.comp": HEAD + FOUND + "void main() { found[0] = 3; found[1] = 1; found[2] = 1; }\n",
        "double.comp": DOUBLE,
    }
    count = ComputeProgram(resources, "count", writes=("found as found",))
    resources["commands"] = resources.context.buffer(bytes(16))
    resources.alias("found", "commands")
    count.dispatch(1)
    resources["found"] = resources.context.buffer(bytes(16))
    program = ComputeProgram(resources, "double", reads=("given",), writes=("found",))
    barriers.clear()
    program.dispatch_indirect("commands")
    assert len(barriers) == 1
    assert barriers[0] & moderngl.Context.COMMAND_BARRIER_BIT
    assert integers(resources) == [2, 4, 6, 0]


@pytest.mark.parametrize(
    ("reads", "writes", "unused"),
    [
        (("given", "seen"), ("found",), "seen"),
        (("given", "numbers"), ("found",), "numbers"),
        (("given",), ("found", "shown"), "shown"),
        (("given", "found as other"), ("found",), "other"),
        (("given", "giv"), ("found",), "giv"),
    ],
)
def test_what_is_declared_and_not_used_is_refused(resources, shaders, reads, writes, unused):
    shaders["double.comp"] = DOUBLE
    with pytest.raises(ValueError, match=f"^double: declares '{unused}', which its shader does not use$"):
        ComputeProgram(resources, "double", reads=reads, writes=writes)


def test_a_buffer_that_is_not_declared_does_not_compile(resources, shaders):
    shaders["double.comp"] = DOUBLE + OTHER
    with pytest.raises(ShaderError, match=r"double\.comp:5\b.*OTHER_BINDING"):
        ComputeProgram(resources, "double", reads=("given",), writes=("found",))


def test_an_image_that_is_only_read_does_not_compile(resources, shaders):
    """An image has its place among what is written."""
    shaders["show.comp"] = SHOW
    with pytest.raises(ShaderError, match="SHOWN_IMAGE"):
        ComputeProgram(resources, "show", reads=("given", "shown"))


def test_a_sampler_that_is_used_must_be_declared(resources, shaders):
    shaders["sample.comp"] = SAMPLE
    with pytest.raises(ValueError, match="^sample: samples 'seen', which it does not declare$"):
        ComputeProgram(resources, "sample", writes=("found",))


def test_a_sampler_that_an_include_brings_and_nobody_uses_need_not_be_declared(resources, shaders):
    shaders |= {
        "both.glsl": SEEN + "float at_corner() { return texelFetch(seen, ivec2(0), 0).x; }\n",
        "double.comp": DOUBLE.replace(HEAD, HEAD + '#include "both.glsl"\n'),
    }
    ComputeProgram(resources, "double", reads=("given",), writes=("found",)).dispatch(4)
    assert integers(resources) == [2, 4, 6, 8]


@pytest.mark.parametrize(
    ("reads", "writes"),
    [
        (("given", "given"), ("found",)),
        (("given",), ("found", "given")),
        (("given", "numbers as found"), ("found",)),
    ],
)
def test_a_name_declared_twice_is_refused(resources, shaders, reads, writes):
    shaders["double.comp"] = DOUBLE
    with pytest.raises(ValueError, match=r"^double: a name is declared more than once in \["):
        ComputeProgram(resources, "double", reads=reads, writes=writes)


def test_a_resource_that_is_not_there_is_named(resources, shaders):
    shaders["double.comp"] = DOUBLE
    program = ComputeProgram(resources, "double", reads=("absent as given",), writes=("found",))
    with pytest.raises(KeyError, match="there is no resource called 'absent'"):
        program.dispatch(1)


def test_a_shader_that_is_not_there_is_named(resources, shaders):
    with pytest.raises(ShaderError, match="shaders/absent.comp: cannot be read"):
        ComputeProgram(resources, "absent")


def test_a_mistake_is_told_by_file_and_line(resources, shaders):
    shaders |= {
        "inner.glsl": "int one() {\n    return 1 +;\n}\n",
        "outer.comp": HEAD + '#include "inner.glsl"\nvoid main() {}\n',
    }
    with pytest.raises(ShaderError, match=r"inner\.glsl:2"):
        ComputeProgram(resources, "outer")


def test_reads_after_writes_have_their_barriers(resources, shaders, barriers):
    """Buffer to storage read, buffer to host, image to sampler: one barrier each, and none twice."""
    shaders |= {"double.comp": DOUBLE, "show.comp": SHOW, "sample.comp": SAMPLE}
    first = ComputeProgram(resources, "double", reads=("given",), writes=("found",))
    show = ComputeProgram(resources, "show", reads=("found as given",), writes=("shown",))
    sample = ComputeProgram(resources, "sample", reads=("shown as seen",), writes=("found",))
    for _ in range(2):
        first.dispatch(4)
        show.dispatch(1)
        sample.dispatch(1)
    barriers.clear()
    first.dispatch(4)
    assert barriers == [STORAGE], "found was written by the last sample"
    show.dispatch(1)
    assert barriers[1:] == [STORAGE | IMAGE], "found was written, and shown was read"
    sample.dispatch(1)
    assert barriers[2:] == [STORAGE | SAMPLED], "shown was written, and found was read"
    assert integers(resources)[0] == 2
    assert barriers[3:] == [moderngl.Context.BUFFER_UPDATE_BARRIER_BIT]
    integers(resources)
    assert len(barriers) == 4


def test_dispatches_that_only_read_have_no_barriers_between_them(resources, shaders, barriers, gl_context):
    """Into a buffer of its own each: nothing is ordered that need not be."""
    shaders["double.comp"] = DOUBLE
    programs = []
    for index in range(3):
        resources[f"found_{index}"] = gl_context.buffer(bytes(16))
        programs.append(
            ComputeProgram(resources, "double", reads=("given",), writes=(f"found_{index} as found",))
        )
    programs[0].dispatch(4)
    barriers.clear()
    for program in programs[1:]:
        program.dispatch(4)
    assert barriers == []


def test_a_raster_program_binds_what_it_reads(resources, shaders, gl_context):
    shaders |= {
        "fill.vert": "void main() {\n"
        "    vec2 corner = vec2(gl_VertexID % 2, gl_VertexID / 2);\n"
        "    gl_Position = vec4(4.0 * corner - 1.0, 0.5, 1.0);\n}\n",
        "fill.frag": GIVEN + SEEN + "uniform int factor;\nout vec4 color;\n"
        "void main() { color = vec4(given[1] * factor, texelFetch(seen, ivec2(0), 0).x, 0.0, 1.0); }\n",
    }
    program = RasterProgram(resources, "fill", reads=("seen", "given"))
    assert {program.unit("seen"), program.unit("given")} == {0, 1}
    target = gl_context.texture((2, 2), 4, dtype="f4")
    framebuffer = gl_context.framebuffer([target])
    framebuffer.use()
    gl_context.enable_only(moderngl.NOTHING)
    program.bind(factor=5)
    gl_context.vertex_array(program.program, []).render(moderngl.TRIANGLES, vertices=3)
    pixels = np.frombuffer(target.read(), np.float32).reshape(-1, 4)
    np.testing.assert_array_equal(pixels, np.tile(np.float32([10.0, 7.0, 0.0, 1.0]), (4, 1)))


def test_a_raster_program_is_held_to_what_it_declares(resources, shaders):
    shaders |= {"fill.vert": "void main() { gl_Position = vec4(0.0); }\n"}
    shaders["fill.frag"] = SEEN + "out vec4 color;\nvoid main() { color = texelFetch(seen, ivec2(0), 0); }\n"
    with pytest.raises(ValueError, match="^fill: samples 'seen', which it does not declare"):
        RasterProgram(resources, "fill")
    with pytest.raises(ValueError, match="^fill: declares 'given', which its shader does not use"):
        RasterProgram(resources, "fill", reads=("seen", "given"))
    shaders["fill.frag"] = "out vec4 color;\nvoid main() { color = vec4(1.0) }\n"
    with pytest.raises(ShaderError, match=r"fill\.frag:2"):
        RasterProgram(resources, "fill")


@pytest.fixture
def compiled(monkeypatch) -> list[str]:
    """The kind of every program that is compiled on any context."""
    kinds = []
    for name in ("compute_shader", "program"):
        original = getattr(moderngl.Context, name)

        def call(*arguments, _original=original, _name=name, **keywords):
            kinds.append(_name)
            return _original(*arguments, **keywords)

        monkeypatch.setattr(moderngl.Context, name, call)
    return kinds


def test_one_text_is_compiled_once_for_each_context(resources, shaders, compiled, gl_context):
    """However many programs share it, of whatever resources; other defines make another text."""
    shaders["double.comp"] = DOUBLE + "// of this test alone\n"
    programs = [
        ComputeProgram(resources.child(), "double", reads=("given",), writes=("found",)) for _ in range(3)
    ]
    programs.append(ComputeProgram(resources, "double", reads=("seen as given",), writes=("found",)))
    assert compiled == ["compute_shader"]
    ComputeProgram(resources, "double", {"LEVEL": 2}, reads=("given",), writes=("found",))
    assert len(compiled) == 2
    other = create_context()
    ComputeProgram(Resources(other), "double", reads=("given",), writes=("found",))
    assert len(compiled) == 3
    gl_context.__enter__()
    programs[0].dispatch(4)
    assert integers(resources) == [2, 4, 6, 8]


def everything() -> tuple[View, TunedConfig, DynamicLights]:
    view = room_view("spot", (32, 24))
    lights = DynamicLights(point_lights(np.zeros((4, 3)), np.full(3, 0.05), 0.5))
    parameters = point_vpls(vpl_count=64, density_importance=0.5, screen_space_strength=1.0)
    config = TunedConfig(
        parameters,
        auto=made_prior(),
        quality=Quality(interleave=4, map_size=8, rsm_resolution=64),
        light=ONE_BOUNCE,
    )
    return View("all", view.split, view.size, view.camera, tuple(ROOM_LIGHTS.values())), config, lights


def test_a_second_runtime_compiles_nothing(gl_context, compiled):
    view, config, lights = everything()
    options = RuntimeOptions(light_path="tiles")
    first = Runtime(colored_room(), options, context=gl_context).render_radiance(view, config, lights=lights)
    compiled.clear()
    second = Runtime(colored_room(), options, context=gl_context).render_radiance(view, config, lights=lights)
    assert compiled == []
    np.testing.assert_array_equal(second, first)


@pytest.mark.parametrize("light_path", ["volumes", "tiles"])
def test_every_resource_has_a_place_of_its_own_and_drivers_have_enough(gl_context, monkeypatch, light_path):
    """Two at one place would each be read as the other, without an error."""
    declared = []
    original = gpu_program._Declaration.__init__

    def declare(self, *arguments):
        original(self, *arguments)
        declared.append(self)

    monkeypatch.setattr(gpu_program._Declaration, "__init__", declare)
    runtime = Runtime(colored_room(), RuntimeOptions(light_path=light_path), context=gl_context)
    view, config, lights = everything()
    runtime.draw(view, config, lights=lights).read_statistics()
    discs = ArtistParameters(vpl_count=64, lloyd_iterations=1)
    runtime.draw(view, TunedConfig(discs, quality=config.quality, light=ONE_BOUNCE))
    assert len({each.shader for each in declared}) > 25
    for each in declared:
        assert sorted(each.units.values()) == list(range(len(each.units))), each.shader
        assert sorted(each.image_units.values()) == list(range(len(each.writes))), each.shader
        assert len(each.units) <= MOST_BINDINGS, each.shader
        # OpenGL 4.5 guarantees that many images in a compute shader.
        assert len(each.image_units) <= 8, each.shader
