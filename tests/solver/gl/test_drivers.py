"""Drivers that render on the processor are known by their names."""

import pytest

from ripple_sim.solver.gl import is_software, shared_context

PROCESSOR = [
    "llvmpipe (LLVM 15.0.7, 256 bits)",
    "softpipe",
    "Mesa Software Rasterizer",
    "SWR (LLVM 12.0.0, 256 bits)",
    "LLVMPIPE",
]
GPU = [
    "NVIDIA H200/PCIe/SSE2",
    "AMD Radeon RX 6800 (radeonsi, navi21, LLVM 15.0.7, DRM 3.49)",
    "Mesa Intel(R) UHD Graphics 620 (KBL GT2)",
    "Apple M1",
    "D3D12 (NVIDIA GeForce RTX 3080)",
]


@pytest.mark.parametrize("renderer", PROCESSOR)
def test_software_drivers_are_told_by_their_name(renderer: str) -> None:
    assert is_software(renderer)


@pytest.mark.parametrize("renderer", GPU)
def test_drivers_of_gpus_are_not_taken_for_software(renderer: str) -> None:
    assert not is_software(renderer)


def test_a_context_knows_what_its_own_driver_is(opengl: None) -> None:
    context = shared_context()
    assert context.software == is_software(context.renderer)
