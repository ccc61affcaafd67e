"""The Mitsuba variant is tried in a child process, and the result is cached."""

import subprocess
import sys
from pathlib import Path

import pytest

from vpltune.renderer.errors import InputError
from vpltune.tuner.reference import describe_variant, variant


@pytest.fixture(autouse=True)
def nothing_remembered(monkeypatch, tmp_path):
    monkeypatch.setenv("VPLTUNE_CACHE", str(tmp_path))
    monkeypatch.delenv("VPLTUNE_MITSUBA_VARIANT", raising=False)
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    variant._chosen_variant.cache_clear()
    yield
    variant._chosen_variant.cache_clear()


def probe_that(monkeypatch, works_on, *, aborts=True):
    """Replaces the probe: it works with one library and aborts or hangs with others. Returns those tried."""
    tried = []

    def run(command, *, env, capture_output, timeout):
        tried.append(env.get("DRJIT_LIBLLVM_PATH"))
        if tried[-1] == works_on:
            return subprocess.CompletedProcess(command, 0)
        if aborts:
            return subprocess.CompletedProcess(command, -6)
        raise subprocess.TimeoutExpired(command, timeout)

    monkeypatch.setattr(variant.subprocess, "run", run)
    return tried


def test_the_first_library_that_works_is_taken_and_kept(monkeypatch):
    monkeypatch.setattr(variant, "llvm_libraries", lambda: [Path("/new.so"), Path("/old.so")])
    tried = probe_that(monkeypatch, "/old.so")
    found = describe_variant()
    assert (found.name, found.libllvm) == ("llvm_ad_rgb", "/old.so")
    assert tried == ["/new.so", "/old.so"]
    variant._chosen_variant.cache_clear()
    assert describe_variant() == found
    assert len(tried) == 2


def test_without_llvm_the_scalar_variant_serves_and_says_so(monkeypatch):
    monkeypatch.setattr(variant, "llvm_libraries", lambda: [Path("/old.so")])
    tried = probe_that(monkeypatch, "none")
    found = describe_variant()
    assert found.name == "scalar_rgb"
    assert "/old.so" in found.sentence and "libllvm19" in found.sentence
    assert tried == ["/old.so", None]


def test_a_probe_that_hung_is_tried_again_next_time(monkeypatch):
    monkeypatch.setattr(variant, "llvm_libraries", lambda: [])
    tried = probe_that(monkeypatch, "none", aborts=False)
    assert describe_variant().name == "scalar_rgb"
    variant._chosen_variant.cache_clear()
    describe_variant()
    assert len(tried) == 2


def test_the_environment_can_force_a_variant(monkeypatch):
    monkeypatch.setattr(variant.subprocess, "run", None)
    monkeypatch.setenv("VPLTUNE_MITSUBA_VARIANT", "scalar_rgb")
    assert describe_variant().name == "scalar_rgb"
    monkeypatch.setenv("VPLTUNE_MITSUBA_VARIANT", "cuda_rgb")
    with pytest.raises(InputError, match="must be llvm_ad_rgb or scalar_rgb, got 'cuda_rgb'"):
        describe_variant()


def test_libraries_are_sorted_newest_first(monkeypatch, tmp_path):
    names = [
        "libLLVM-14.so.1",
        "libLLVM-15.so.1",
        "libLLVM.so.19.1",
        "libLLVM.so.9",
        "libLLVM.so.100.1",
        "libLLVMx.a",
    ]
    for name in names:
        (tmp_path / name).touch()
    monkeypatch.setenv("LD_LIBRARY_PATH", str(tmp_path))
    found = [path.name for path in variant.llvm_libraries() if path.parent == tmp_path]
    assert found == ["libLLVM.so.100.1", "libLLVM.so.19.1", "libLLVM-15.so.1"]


def test_asking_loads_no_mitsuba():
    program = (
        "import sys; from vpltune.tuner.reference import describe_variant, noise_floor, reference_views;"
        "describe_variant();"
        "print([name for name in ('mitsuba', 'drjit', 'jax') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
