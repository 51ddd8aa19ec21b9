"""The child process that runs fTetWild: it can hang, grow or abort, and must not take the parent with it.

    python _tetwild.py IN.npz OUT.npz     IN: vertex, face, edge, envelope, passes, memory (bytes), seconds

fTetWild shuffles with a seed from `std::random_device`, so two runs differ by 0.1 % in the modes. On ELF systems the
slot of the extension's procedure table that points at `random_device::_M_getval` is turned to a counter of our own:
same surface, same tetrahedra. Elsewhere the cache must keep the mesh. Stands alone (numpy only) so that starting it is
cheap.
"""

from __future__ import annotations

import ctypes
import importlib.util
import struct
import sys
from importlib.machinery import ExtensionFileLoader
from pathlib import Path
from types import ModuleType

import numpy as np

SYMBOL = b"_ZNSt13random_device9_M_getvalEv"  # unsigned std::random_device::_M_getval()
JUMP_SLOT = {62: 7, 183: 1026}  # e_machine -> relocation type: x86-64, aarch64 [System V psABI]
_keep: list[object] = []  # the callback must outlive every call


def load() -> tuple[ModuleType, Path]:
    """The fTetWild extension of the pytetwild wheel, without its package (which imports PyVista)."""
    spec = importlib.util.find_spec("pytetwild")
    if spec is None or not spec.submodule_search_locations:
        raise ImportError("pytetwild is not installed")
    folder = Path(next(iter(spec.submodule_search_locations)))
    file = next(
        f for f in sorted(folder.iterdir()) if f.name.startswith("PyfTetWildWrapper") and f.suffix in (".so", ".pyd")
    )
    found = importlib.util.spec_from_file_location(
        "PyfTetWildWrapper", file, loader=ExtensionFileLoader("PyfTetWildWrapper", str(file))
    )
    assert found is not None and found.loader is not None
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module, file


def seed(file: Path) -> bool:
    """Turn the extension's random device to a fixed sequence; False where the file is no 64-bit little-endian ELF."""
    data = file.read_bytes()
    if data[:6] != b"\x7fELF\x02\x01":
        return False
    machine = struct.unpack_from("<H", data, 18)[0]
    section_at = struct.unpack_from("<Q", data, 40)[0]
    entry, count = struct.unpack_from("<HH", data, 58)
    sections = [struct.unpack_from("<IIQQQQIIQQ", data, section_at + k * entry) for k in range(count)]
    base = next(
        (
            int(line.split("-")[0], 16)
            for line in Path("/proc/self/maps").read_text().splitlines()
            if line.endswith(str(file))
        ),
        None,
    )
    if base is None or machine not in JUMP_SLOT:
        return False
    state = np.array([12345], np.uint32)

    def value(_: object) -> int:
        state[0] = (int(state[0]) * 1664525 + 1013904223) & 0xFFFFFFFF  # [Numerical Recipes 1992, eq. 7.1.6]
        return int(state[0])

    callback = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_void_p)(value)
    _keep.append(callback)
    done = False
    for section in sections:
        if section[1] != 4:  # SHT_RELA
            continue
        symbols = sections[section[6]]
        names = sections[symbols[6]]
        for at in range(section[4], section[4] + section[5], 24):
            slot, info, _ = struct.unpack_from("<QQq", data, at)
            if info & 0xFFFFFFFF != JUMP_SLOT[machine]:
                continue
            name_at = names[4] + struct.unpack_from("<I", data, symbols[4] + 24 * (info >> 32))[0]
            if data[name_at : data.index(b"\0", name_at)] == SYMBOL:
                ctypes.c_void_p.from_address(base + slot).value = ctypes.cast(callback, ctypes.c_void_p).value
                done = True
    return done


def main() -> None:
    source, target = sys.argv[1:]
    with np.load(source, allow_pickle=False) as given:
        arguments = {name: given[name] for name in given.files}
    try:
        import resource

        for what, name in ((resource.RLIMIT_AS, "memory"), (resource.RLIMIT_CPU, "seconds")):
            resource.setrlimit(what, (int(arguments[name]), int(arguments[name])))
    except (ImportError, ValueError):  # no such limit on this system: the time limit alone guards
        pass
    module, file = load()
    seeded = seed(file)
    none = np.zeros((0, 3)), np.zeros((0, 4), np.int32), np.zeros(0)
    vertex, face = (
        np.ascontiguousarray(arguments["vertex"], np.float64),
        np.ascontiguousarray(arguments["face"], np.uint32),
    )
    # optimize, skip_simplify, edge (relative, absolute), envelope (relative), stop_energy, coarsen, threads,
    # iterations, log level,
    # quiet, vtk_ordering, disable_filtering, sizing field
    node, tet = module.tetrahedralize_mesh(
        vertex,
        face,
        True,
        False,
        0.05,
        float(arguments["edge"]),
        float(arguments["envelope"]),
        10.0,
        False,
        1,
        int(arguments["passes"]),
        6,
        True,
        False,
        False,
        *none,
    )
    np.savez(target, node=node, tet=tet, seeded=seeded)


if __name__ == "__main__":
    main()
