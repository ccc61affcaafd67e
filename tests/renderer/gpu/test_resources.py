"""Resources by name, and the memory barriers between their uses: all that are needed, and no others.

What is needed is in OpenGL 4.6 core, 7.13.2: an access of some kind sees what a shader wrote through a
storage buffer or an image before the last barrier of that kind, and a shader's write comes after earlier
accesses only if such a barrier stands between.
"""

import moderngl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded_calls import RecordingBuffer, RecordingContext

from vpltune.renderer.gpu.resources import (
    COMMANDS,
    HOST_BUFFER,
    HOST_TEXTURE,
    IMAGE,
    SAMPLED,
    STORAGE,
    Access,
    Resources,
)

KINDS = (SAMPLED, IMAGE, STORAGE, COMMANDS, HOST_BUFFER, HOST_TEXTURE)
NAMES = ("a", "b", "c")


def settled(*names: str) -> tuple[RecordingContext, Resources]:
    """Resources of which every kind of access has had its first barrier."""
    context = RecordingContext()
    resources = Resources(context)
    for name in names:
        resources[name] = RecordingBuffer(context)
    resources.access([Access(name, kind, writes=True) for name in names for kind in KINDS])
    resources.access([Access(name, kind) for name in names for kind in KINDS])
    context.taken()
    return context, resources


def read(name: str, kind: int = STORAGE) -> tuple[Access]:
    return (Access(name, kind),)


def write(name: str, kind: int = STORAGE) -> tuple[Access]:
    return (Access(name, kind, writes=True),)


def test_kinds_are_barriers_of_their_own():
    assert len(set(KINDS)) == len(KINDS)
    assert all(kind.bit_count() == 1 for kind in KINDS)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("by", [STORAGE, IMAGE])
def test_what_a_shader_wrote_is_seen(by, kind):
    """One barrier, of the reader's kind; another reader of the same kind needs none."""
    context, resources = settled("a")
    resources.access(write("a", by))
    context.taken()
    resources.access(read("a", kind))
    assert context.taken() == [kind]
    resources.access(read("a", kind))
    assert context.taken() == []


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("by", [STORAGE, IMAGE])
def test_a_write_comes_after_earlier_uses(by, kind):
    """Whatever the use was: one barrier of the writer's kind, and none once it has been placed."""
    context, resources = settled("a")
    resources.access(read("a", kind))
    resources.access(write("a", by))
    assert context.taken() == [by]


@pytest.mark.parametrize("by", [STORAGE, IMAGE])
def test_a_write_comes_after_a_write(by):
    context, resources = settled("a")
    for _ in range(3):
        resources.access(write("a", by))
    assert context.taken() == [by] * 3


def test_reads_need_nothing_between_them():
    context, resources = settled("a")
    for kind in KINDS * 3:
        resources.access(read("a", kind))
    assert context.taken() == []


def test_a_command_has_one_barrier_for_all_that_it_uses():
    context, resources = settled("a", "b", "c")
    for name in NAMES:
        resources.access(write(name))
    context.taken()
    resources.access((Access("a", SAMPLED), Access("b", STORAGE), Access("c", COMMANDS)))
    assert context.taken() == [SAMPLED | STORAGE | COMMANDS]


def test_a_barrier_serves_every_resource():
    """It is the context's, not one buffer's: what was written before it needs no second one."""
    context, resources = settled("a", "b")
    resources.access((Access("a", STORAGE, writes=True), Access("b", IMAGE, writes=True)))
    context.taken()
    resources.access(read("a", SAMPLED))
    resources.access(read("b", SAMPLED))
    assert context.taken() == [SAMPLED]


def test_a_barrier_of_one_kind_does_not_serve_another():
    context, resources = settled("a")
    resources.access(write("a"))
    resources.access(read("a", SAMPLED))
    context.taken()
    for kind in (STORAGE, COMMANDS, HOST_BUFFER):
        resources.access(read("a", kind))
    assert context.taken() == [STORAGE, COMMANDS, HOST_BUFFER]


def test_what_one_shader_reads_and_writes_is_ordered_against_both():
    """Read by the first, written by the second, read by the third: two barriers."""
    context, resources = settled("a", "b")
    resources.access((Access("a", STORAGE), Access("b", STORAGE, writes=True)))
    context.taken()
    resources.access((Access("b", STORAGE), Access("a", STORAGE, writes=True)))
    assert context.taken() == [STORAGE]
    resources.access(read("a"))
    assert context.taken() == [STORAGE]


def test_nothing_is_known_of_a_new_resource():
    """It may have been written before it came here: the first use of each kind has a barrier."""
    context = RecordingContext()
    resources = Resources(context)
    resources["a"] = RecordingBuffer(context)
    for kind in (STORAGE, SAMPLED, STORAGE, SAMPLED):
        resources.access(read("a", kind))
    assert context.taken() == [STORAGE, SAMPLED]


def test_the_same_resource_put_again_is_not_new():
    context, resources = settled("a")
    resources["a"] = resources["a"]
    resources.access(read("a"))
    assert context.taken() == []
    resources["a"] = RecordingBuffer(context)
    resources.access(read("a"))
    assert context.taken() == [STORAGE]


def test_writes_and_reads_of_the_cpu_are_ordered():
    """After what shaders wrote; and a shader's write after them. OpenGL itself orders the rest."""
    context, resources = settled("a", "b")
    resources.access(write("a"))
    context.taken(), context.calls.clear()
    assert resources.read("a", 4) == bytes(4)
    resources.write("a", b"1234")
    resources.access(read("a"))
    assert (context.calls, context.taken()) == (
        ["barrier", "read", "write", "barrier"],
        [HOST_BUFFER, STORAGE],
    )
    resources.access(write("a"))
    assert context.taken() == [STORAGE]


def test_a_copy_waits_for_both_sides():
    context, resources = settled("a", "b")
    resources["b"] = RecordingBuffer(context, 12)
    resources.access(write("a"))
    context.taken(), context.calls.clear()
    resources.copy("a", "b")
    assert (context.calls, context.taken()) == (["barrier", "copy 12"], [HOST_BUFFER])
    resources.access(write("a"))
    assert context.taken() == [STORAGE], "the copy has read it"


def test_an_alias_shares_what_is_known():
    context, resources = settled("a", "b")
    resources.alias("indirect", "a")
    assert resources["indirect"] is resources["a"]
    resources.access(write("a"))
    context.taken()
    resources.access(read("indirect"))
    assert context.taken() == [STORAGE]
    resources.access(read("a"))
    assert context.taken() == []
    resources.access(write("indirect"))
    context.taken()
    resources.alias("indirect", "b")
    assert resources["indirect"] is resources["b"]
    resources.access(read("indirect"))
    assert context.taken() == [], "it is another resource now"
    resources.access(read("a"))
    assert context.taken() == [STORAGE]


def test_an_alias_stays_with_what_it_named():
    """Another resource under the name that it was made from is not its own."""
    context, resources = settled("a")
    first = resources["a"]
    resources.alias("indirect", "a")
    resources["a"] = RecordingBuffer(context)
    assert resources["indirect"] is first


def test_a_child_falls_back_and_puts_its_own_in_place():
    context, resources = settled("a", "b")
    child = resources.child()
    assert child["a"] is resources["a"]
    child["a"] = RecordingBuffer(context, 99)
    assert child.buffer("a").size == 99
    assert resources.buffer("a").size == 16
    assert child["b"] is resources["b"]
    assert "a" in child and "b" in child and "c" not in child
    child["c"] = RecordingBuffer(context)
    assert "c" not in resources
    resources["d"] = RecordingBuffer(context)
    assert child["d"] is resources["d"]


def test_a_child_shares_what_is_known_of_its_parents_resources():
    context, resources = settled("a")
    child = resources.child()
    child.access(write("a"))
    context.taken()
    resources.access(read("a"))
    assert context.taken() == [STORAGE]
    child.access(read("a"))
    assert context.taken() == []
    child["a"] = RecordingBuffer(context)
    child.access(write("a"))
    context.taken()
    resources.access(read("a"))
    assert context.taken() == [], "the child's own is another"


def test_names_that_are_not_there_and_kinds_that_they_are_not():
    context, resources = settled("a")
    for lookup in (
        lambda: resources["x"],
        lambda: resources.buffer("x"),
        lambda: resources.texture("x"),
        lambda: resources.alias("y", "x"),
        lambda: resources.access(read("x")),
        lambda: resources.child()["x"],
    ):
        with pytest.raises(KeyError, match="there is no resource called 'x'"):
            lookup()
    with pytest.raises(KeyError, match="resource 'a' is no texture"):
        resources.texture("a")
    assert context.taken() == []


def test_textures_are_told_from_buffers(gl_context):
    resources = Resources(gl_context)
    resources["image"] = texture = gl_context.texture((1, 1), 4)
    assert resources.texture("image") is texture
    with pytest.raises(KeyError, match="resource 'image' is no buffer"):
        resources.buffer("image")


class Model:
    """When each thing last happened: what OpenGL asks for, told in another way."""

    def __init__(self):
        self.now = 0
        self.barrier = dict.fromkeys(KINDS, -1)
        self.written: dict[object, int] = {}
        self.used: dict[object, int] = {}

    def put(self, resource: object) -> None:
        self.now += 1
        self.written[resource] = self.used[resource] = self.now

    def needed(self, accesses: list[tuple[object, int, bool]]) -> int:
        """The barrier that must stand before a command."""
        missing = 0
        for resource, kind, writes in accesses:
            if self.barrier[kind] < self.written[resource]:
                missing |= kind
            if writes and self.barrier[kind] < self.used[resource]:
                missing |= kind
        return missing

    def passed(self, barrier: int, accesses: list[tuple[object, int, bool]]) -> None:
        """That barrier was placed, and then the command ran."""
        self.now += 1
        self.barrier |= {kind: self.now for kind in KINDS if barrier & kind}
        self.now += 1
        for resource, _, writes in accesses:
            self.used[resource] = self.now
            if writes:
                self.written[resource] = self.now


ACCESSES = st.builds(
    lambda name, way: (name, *way),
    st.sampled_from(NAMES),
    st.sampled_from([(kind, False) for kind in KINDS] + [(STORAGE, True), (IMAGE, True)]),
)
STEPS = st.one_of(
    st.lists(ACCESSES, min_size=1, max_size=4),
    st.tuples(st.just("put"), st.sampled_from(NAMES)),
    st.tuples(st.just("alias"), st.sampled_from(NAMES), st.sampled_from(NAMES)),
)


@given(steps=st.lists(STEPS, max_size=30))
@settings(max_examples=300, deadline=None, derandomize=True)
def test_barriers_are_exactly_those_that_are_needed(steps):
    """Any sequence of commands, new resources and aliases, against the times at which things happened."""
    context, model = RecordingContext(), Model()
    resources = Resources(context)
    for name in NAMES:
        resources[name] = RecordingBuffer(context)
        model.put(resources[name])
    for step in steps:
        if isinstance(step, list):
            used = [(resources[name], kind, writes) for name, kind, writes in step]
            needed = model.needed(used)
            resources.access([Access(*access) for access in step])
            assert context.taken() == ([needed] if needed else [])
            model.passed(needed, used)
        elif step[0] == "put":
            resources[step[1]] = RecordingBuffer(context)
            model.put(resources[step[1]])
        else:
            resources.alias(step[1], step[2])


@given(steps=st.lists(st.tuples(st.booleans(), st.lists(ACCESSES, min_size=1, max_size=3)), max_size=30))
@settings(max_examples=200, deadline=None, derandomize=True)
def test_a_child_misses_no_barrier(steps):
    """Commands of a parent and a child in turn: at least what is needed; one may be placed twice."""
    context, model = RecordingContext(), Model()
    parent = Resources(context)
    for name in NAMES:
        parent[name] = RecordingBuffer(context)
        model.put(parent[name])
    child = parent.child()
    child["c"] = RecordingBuffer(context)
    model.put(child["c"])
    for in_child, step in steps:
        resources = child if in_child else parent
        used = [(resources[name], kind, writes) for name, kind, writes in step]
        resources.access([Access(*access) for access in step])
        placed = context.taken()
        assert len(placed) <= 1
        assert model.needed(used) & ~sum(placed) == 0
        model.passed(sum(placed), used)


def test_a_real_context_takes_them(gl_context):
    """Every kind at once, without an OpenGL error."""
    resources = Resources(gl_context)
    resources["a"] = gl_context.buffer(reserve=16)
    resources["image"] = gl_context.texture((1, 1), 4, dtype="f4")
    resources.access([Access("a", kind, writes=True) for kind in KINDS])
    resources.access([Access("image", kind) for kind in KINDS])
    resources.write("a", bytes(range(16)))
    resources["b"] = gl_context.buffer(reserve=8)
    resources.copy("a", "b")
    assert resources.read("b") == bytes(range(8))
    assert resources.read("a", 4) == bytes(range(4))
    assert gl_context.error == "GL_NO_ERROR"
    assert isinstance(resources["a"], moderngl.Buffer)
